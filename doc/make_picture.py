"""Draw the README's picture from a golden bag: ``python doc/make_picture.py``."""

from pathlib import Path

import matplotlib
import numpy as np

from deck_motion_ros.evaluation.record import read_record
from deck_motion_ros.samples import NANOSECONDS

ROOT = Path(__file__).resolve().parents[1]
BAG = ROOT / 'bags' / 'destroyer_202611B'


def main() -> None:
    """Draw what came, what was said 3 s before, and its 95 % interval."""
    matplotlib.use('Agg')
    from matplotlib import pyplot as plt

    record = read_record(BAG)
    said, = record.height.against(record.came(), record.was())
    start, end = record.span
    stamps = np.arange(start, end, NANOSECONDS // 10)

    def time(stamp):
        return (stamp - start) / NANOSECONDS

    figure, axes = plt.subplots(figsize=(9.6, 3.2), layout='constrained')
    half = 1.96 * said.sd
    gaps = np.flatnonzero(np.diff(said.valid_at) > NANOSECONDS) + 1
    for part in np.split(np.arange(len(said)), gaps):
        axes.fill_between(time(said.valid_at[part]), (said.mean - half)[part],
                          (said.mean + half)[part], color='#a9d3ee', alpha=0.6, linewidth=0)
        axes.plot(time(said.valid_at[part]), said.mean[part], color='#0072b2', linewidth=1.3)
    axes.plot(time(stamps), record.came()(stamps), color='#555b61', linewidth=1.0)
    axes.axvspan(70, 82, color='#d55e00', alpha=0.12, linewidth=0)
    axes.text(76, axes.get_ylim()[1], 'no input', ha='center', va='top', color='#d55e00')
    axes.set(xlabel='time (s)', ylabel='height of the touchdown point (m)',
             xlim=(20, time(end)))
    axes.spines[['top', 'right']].set_visible(False)
    figure.savefig(ROOT / 'doc' / 'forecast.png', dpi=100)


if __name__ == '__main__':
    main()

"""Run one bench in this process; print figures, progress and remarks as lines of JSON."""

from dataclasses import asdict
import json
import sys

from deck_motion_ros.bench import BENCHES
from deck_motion_ros.bench.figures import Figure

if __name__ == '__main__':
    for item in BENCHES[sys.argv[1]]():
        print(json.dumps(asdict(item) if isinstance(item, Figure) else item), flush=True)

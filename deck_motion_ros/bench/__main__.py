"""Run one bench in this process and print its figures as JSON."""

from dataclasses import asdict
import json
import sys

from deck_motion_ros.bench import BENCHES

if __name__ == '__main__':
    print(json.dumps([asdict(figure) for figure in BENCHES[sys.argv[1]]()]))

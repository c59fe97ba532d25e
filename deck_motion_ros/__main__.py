"""``python -m deck_motion_ros``."""

from deck_motion_ros.cli import main

if __name__ == '__main__':
    main()

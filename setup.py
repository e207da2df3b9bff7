"""What catkin installs of the Python package; not for use by itself."""
from distutils.core import setup

from catkin_pkg.python_setup import generate_distutils_setup

setup(**generate_distutils_setup(
    packages=[
        "behavior_controller",
        "behavior_controller.bt",
        "behavior_controller.bt.checking",
        "behavior_controller.bt.engine",
        "behavior_controller.bt.language",
        "behavior_controller.interface",
        "behavior_controller.leaves",
        "behavior_controller.ros",
        "behavior_controller.watch",
    ],
    package_data={"behavior_controller.watch": ["page_files/*"]},
    package_dir={"": "src"},
))

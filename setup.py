"""What catkin and pip install of the Python package; pyproject.toml says what pip alone needs. Not for use by itself."""
from distutils.core import setup
from xml.etree import ElementTree

manifest = ElementTree.parse("package.xml")

setup(
    name=manifest.findtext("name"),
    version=manifest.findtext("version"),
    description=" ".join((manifest.findtext("description") or "").split()),
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
    package_data={"behavior_controller.watch": ["page_files/*", "report_files/*"]},
    package_dir={"": "src"},
)

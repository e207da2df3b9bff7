"""What catkin and pip install of the Python package; pyproject.toml says what pip alone needs. Not
for use by itself."""
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
        "behavior_controller.bt.engine",
        "behavior_controller.bt.linter",
        "behavior_controller.bt.loader",
        "behavior_controller.bt.script",
        "behavior_controller.bt.values",
        "behavior_controller.config",
        "behavior_controller.leaves",
        "behavior_controller.missions",
        "behavior_controller.robot",
        "behavior_controller.ros",
        "behavior_controller.run",
        "behavior_controller.run.record",
        "behavior_controller.viewer",
        "behavior_controller.simulation",
        "behavior_controller.simulation.rehearsal",
    ],
    package_data={
        "behavior_controller.viewer": ["page_files/*", "report_files/*"],
        "behavior_controller.simulation.rehearsal": ["report_files/*"],
    },
    package_dir={"": "src"},
)

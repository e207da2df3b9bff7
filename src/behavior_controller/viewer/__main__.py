"""Runs ``missionViewer`` as a child of the controller."""
from behavior_controller import command

command.run("missionViewer", "behavior_controller.viewer.main")

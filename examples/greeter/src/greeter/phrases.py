"""What this package's robot says; the texts are in data/phrases_<language>.ini."""
from behavior_controller.extend import Speech

SPEECHES = (Speech("CuriousSpeech", False, "Says that the robot is curious about its visitor."),)

"""The former place of bt/engine/registry.py, for one release: other packages import it."""
import warnings

from behavior_controller.bt.engine.node_types import Registry  # noqa: F401
from behavior_controller.bt.engine.registry import *  # noqa: F401,F403

warnings.warn("behavior_controller.bt.registry is now behavior_controller.bt.engine.registry",
              FutureWarning, stacklevel=2)

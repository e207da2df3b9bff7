"""The former place of bt/values/status.py, for one release: other packages import it."""
import warnings

from behavior_controller.bt.values.status import *  # noqa: F401,F403

warnings.warn("behavior_controller.bt.status is now behavior_controller.bt.values.status",
              FutureWarning, stacklevel=2)

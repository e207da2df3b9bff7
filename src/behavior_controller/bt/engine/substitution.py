"""Substitution rules: test doubles for nodes of a mission, as BehaviorTree.CPP reads them from JSON (section 14)."""
import fnmatch
import re
from typing import Any, Dict, NamedTuple, Optional

from behavior_controller.bt.engine.clock import Timer
from behavior_controller.bt.engine.leaf import ActionLeaf
from behavior_controller.bt.engine.node import ConfigureError, NodeError, Result
from behavior_controller.bt.language.script import Script, compile_script
from behavior_controller.bt.language.values import to_int
from behavior_controller.bt.status import BY_NAME, FAILURE, IDLE, NAMES, RUNNING, SUCCESS
from behavior_controller.errors import BehaviorControllerError

STATUS_NUMBERS = {"IDLE": 0, "RUNNING": 1, "SUCCESS": 2, "FAILURE": 3, "SKIPPED": 4}
_STATUS_BY_NUMBER = {number: BY_NAME[name] for name, number in STATUS_NUMBERS.items()}


class Substitutions(NamedTuple):
    """``rules``: filter to target; ``configs``: target name to the configuration of its TestNode."""

    rules: Dict[str, Any]
    configs: Dict[str, Dict[str, Any]]

    def target(self, name: str, registration_id: str, path: str) -> Optional[str]:
        """Return the target of the first rule that matches a node, or None. Filters may have ``*`` and ``?``."""
        for pattern, target in self.rules.items():
            if pattern in (name, registration_id) or _matches(pattern, path):
                return target
        return None


def _matches(pattern: str, path: str) -> bool:
    # square brackets are plain letters in BehaviorTree.CPP's filters
    return re.match(fnmatch.translate(pattern.replace("[", "[[]")), path) is not None


def substitutions(rules: Dict[str, Any]) -> Substitutions:
    """Check rules in the JSON form. Raises BehaviorControllerError."""
    configs = rules.get("TestNodeConfigs", {})
    for name, config in configs.items():
        if "return_status" not in config and "return_status_script" not in config:
            raise BehaviorControllerError(
                "TestNodeConfig [{}] must contain return_status or return_status_script".format(name))
    return Substitutions(rules.get("SubstitutionRules", {}), configs)


class TestNode(ActionLeaf):
    """A leaf that completes as its configuration says, after ``async_delay`` ms."""

    __test__ = False  # not a test case, whatever pytest makes of the name

    def __init__(self, name: str, config: Dict[str, Any]):
        super().__init__(name)
        self.config = config
        self.scripts: Dict[str, Script] = {}
        self.timer: Optional[Timer] = None
        self.over = False

    def configure(self) -> None:
        """Check the status and read the scripts."""
        if self.config.get("return_status") == "IDLE":
            raise ConfigureError("TestNode return_status resolved to invalid status (integer value: 0)")
        for key in ("return_status_script", "success_script", "failure_script", "post_script"):
            if self.config.get(key):
                self.scripts[key] = compile_script(self.config[key])

    def on_start(self) -> Result:
        """Complete, or start the timer."""
        delay = self.config.get("async_delay", 0)
        if not delay:
            return self._complete()
        self.over = False
        self.timer = self.clock.call_after(delay / 1000.0, self._due)
        return RUNNING

    def _due(self) -> None:
        self.over = True
        self.wake()

    def on_running(self) -> Result:
        """Wait for the timer."""
        return self._complete() if self.over else RUNNING

    def on_halted(self) -> None:
        """Cancel the timer."""
        if self.timer is not None:
            self.timer.cancel()

    def _complete(self) -> Result:
        result = self._status()
        self._run({SUCCESS: "success_script", FAILURE: "failure_script"}.get(result, ""))
        self._run("post_script")
        return result

    def _status(self) -> Any:
        if "return_status_script" not in self.scripts:
            return BY_NAME[self.config["return_status"]]
        enums = dict(self.services.enums, **STATUS_NUMBERS)
        number = to_int(self.scripts["return_status_script"].run(self.blackboard, enums))
        result = _STATUS_BY_NUMBER.get(number)
        if result is None or result is IDLE:
            raise NodeError("TestNode return_status resolved to invalid status (integer value: {}); allowed: {}".format(
                number, " ".join(name for status, name in NAMES.items() if status is not IDLE)))
        return result

    def _run(self, key: str) -> None:
        if key in self.scripts:
            self.scripts[key].run(self.blackboard, self.services.enums)

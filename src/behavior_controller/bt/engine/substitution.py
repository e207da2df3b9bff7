"""Substitution rules: test doubles for nodes of a mission, as BehaviorTree.CPP reads them from JSON
(section 14)."""
import fnmatch
from typing import Any, Dict, Optional

from behavior_controller.bt.engine.leaf import TimedAction
from behavior_controller.bt.engine.node import ConfigureError, NodeError, Result
from behavior_controller.bt.script.parser import Script, compile_script
from behavior_controller.bt.values.values import to_int
from behavior_controller.bt.values.status import BY_NAME, FAILURE, NUMBERS, SUCCESS
from behavior_controller.errors import BehaviorControllerError

INVALID_STATUS = "return_status resolved to invalid status"
STATUS_NUMBERS = {name: NUMBERS[status] for name, status in BY_NAME.items()}


class Substitutions:
    """``rules``: filter to target; ``configs``: target name to the configuration of its TestNode.
    """

    def __init__(self, substitutes: Dict[str, Any]):
        """Check the JSON form. Raises BehaviorControllerError."""
        self.rules: Dict[str, Any] = substitutes.get("SubstitutionRules", {})
        self.configs: Dict[str, Dict[str, Any]] = substitutes.get("TestNodeConfigs", {})
        for name, config in self.configs.items():
            if "return_status" not in config and "return_status_script" not in config:
                raise BehaviorControllerError(f"TestNodeConfig [{name}] must contain return_status "
                                              "or return_status_script")

    def target(self, name: str, registration_id: str, path: str) -> Optional[str]:
        """Return the target of the first rule that matches a node, or None. Filters may have ``*``
        and ``?``."""
        for pattern, target in self.rules.items():
            # square brackets are plain letters in BehaviorTree.CPP's filters
            plain = pattern.replace("[", "[[]")
            if pattern in (name, registration_id) or fnmatch.fnmatchcase(path, plain):
                return target
        return None


class TestNode(TimedAction):
    """A leaf that completes as its configuration says, after ``async_delay`` ms."""

    __test__ = False  # not a test case, whatever pytest makes of the name

    def __init__(self, name: str, config: Dict[str, Any]):
        super().__init__(name)
        self.config = config
        self.scripts: Dict[str, Script] = {}

    def configure(self) -> None:
        """Check the status and read the scripts."""
        if self.config.get("return_status") == "IDLE":
            raise ConfigureError(f"TestNode {INVALID_STATUS} (integer value: 0)")
        for key in ("return_status_script", "success_script", "failure_script", "post_script"):
            if self.config.get(key):
                self.scripts[key] = compile_script(self.config[key])

    def on_start(self) -> Result:
        """Complete, or start the timer."""
        return self.begin(self.config.get("async_delay", 0))

    def completed(self) -> Result:
        """Run the scripts and return the status."""
        result = self._status()
        own = {SUCCESS: "success_script", FAILURE: "failure_script"}.get(result, "")
        for key in (own, "post_script"):
            if key in self.scripts:
                self.scripts[key].run(self.blackboard, self.services.enums)
        return result

    def _status(self) -> Any:
        if "return_status_script" not in self.scripts:
            return BY_NAME[self.config["return_status"]]
        enums = dict(self.services.enums, **STATUS_NUMBERS)
        number = to_int(self.scripts["return_status_script"].run(self.blackboard, enums))
        allowed = list(BY_NAME)[1:]  # all but IDLE
        if not 0 < number <= len(allowed):
            wrong = f"TestNode {INVALID_STATUS} (integer value: {number})"
            raise NodeError(f"{wrong}; allowed: {' '.join(allowed)}")
        return BY_NAME[allowed[number - 1]]

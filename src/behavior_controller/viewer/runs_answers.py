"""The server's answers about earlier runs."""
from typing import Any, List, Tuple

from tornado.iostream import StreamClosedError

from behavior_controller.errors import BehaviorControllerError
from behavior_controller.run.statistics import Choice
from behavior_controller.viewer.answers import PageAnswer
from behavior_controller.viewer.earlier_runs import EarlierRuns


class _OfRuns(PageAnswer):
    @property
    def runs(self) -> EarlierRuns:
        return self.settings["runs"]


class _List(_OfRuns):
    """``/runs``: figures and visits, as the query chooses them."""

    async def get(self) -> None:
        chosen = Choice(*(self.get_query_argument(field, "") or "" for field in Choice._fields))
        first = self.get_query_argument("first", "") or "0"
        self.send(await self.runs.list(chosen, int(first) if first.isdecimal() else 0))


class _Compared(_OfRuns):
    """``/compared/RUN/NUMBER/RUN/NUMBER``: two visits."""

    async def get(self, *visits: str) -> None:
        one, number, other, second = visits
        try:
            self.send(await self.runs.compare([(one, int(number)), (other, int(second))]))
        except BehaviorControllerError as error:
            self.refuse(404, str(error))


class _Report(_OfRuns):
    """``/report/RUN``: the report of a run, a page that has its style and script in itself."""

    async def get(self, run: str) -> None:
        self.set_header("Content-Security-Policy", "frame-ancestors 'none'")  # the page has more
        try:
            async for data in self.runs.report(run):
                self.write(data)
                self.note_use()
                await self.flush()
        except BehaviorControllerError as error:
            self.refuse(404, str(error))
        except StreamClosedError:
            return


_RUN = r"([0-9A-Za-z_.-]{1,255})"
_NUMBER = r"([0-9]{1,9})"

ROUTES: List[Tuple[str, Any]] = [
    (r"/runs", _List), (rf"/compared/{_RUN}/{_NUMBER}/{_RUN}/{_NUMBER}", _Compared),
    (rf"/report/{_RUN}", _Report)]
"""The addresses of the answers."""

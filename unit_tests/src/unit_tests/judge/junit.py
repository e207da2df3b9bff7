"""The verdict as JUnit XML, which catkin and build servers collect: one test case for each question
of the verdict."""
from xml.etree import ElementTree

from unit_tests.judge.verdict import Verdict

SUITE = "behaviorControllerTest"


def to_xml(verdict: Verdict, seconds: float, title: str) -> str:
    """Return the text of the file; ``seconds`` is how long the test took, ``title`` what ran."""
    failed = sum(bool(objections) for _, objections in verdict.answers)
    suite = ElementTree.Element("testsuite", name=SUITE, tests=str(len(verdict.answers)),
                                failures=str(failed), errors="0", time=f"{seconds:.3f}")
    for question, objections in verdict.answers:
        case = ElementTree.SubElement(suite, "testcase", classname=SUITE, name=question, time="0")
        if objections:
            ElementTree.SubElement(case, "failure",
                                   message=objections[0]).text = "\n".join(objections)
    ElementTree.SubElement(suite, "system-out").text = f"{title}\n{verdict}"
    return ElementTree.tostring(suite, encoding="unicode")

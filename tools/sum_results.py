"""Print the sum of pytest's results: ``sum_results.py FILE.xml…``. Exit with 0 if none failed."""
import collections
import sys
from xml.etree import ElementTree

COUNTS = ("tests", "failures", "errors", "skipped", "time")


def main(paths) -> int:
    """Add up the counts of JUnit XML files."""
    total = collections.Counter()
    for path in paths:
        for suite in ElementTree.parse(path).iter("testsuite"):
            total.update({key: float(suite.get(key, 0)) for key in COUNTS})
    failed = total["failures"] + total["errors"]
    passed = total["tests"] - failed - total["skipped"]
    print(f"{passed:.0f} passed, {failed:.0f} failed, {total['skipped']:.0f} skipped in "
          f"{total['time']:.0f} s")
    return 0 if passed and not failed else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

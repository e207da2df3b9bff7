"""Variations of the lab tour with one mistake each, as an author makes them in a whole mission, and
sound variations."""
import re

from behavior_controller import folders

with open(folders.mission("lab_tour"), encoding="utf-8") as file:
    TOUR = re.sub(r">\s+<", "><", re.sub(r"<!--.*?-->", "", file.read(), flags=re.DOTALL))
TOUR = re.sub(r"\s+", " ", TOUR).partition("<TreeNodesModel>")[0] + "</root>"

H = "<HandleFallBack/>"


def safe(node):
    return f"<Fallback><{node}/>{H}</Fallback>"


def steps(*nodes):
    return f"<Sequence>{''.join(nodes)}</Sequence>"


def once(text):
    return f'<RunOnce then_skip="false">{text}</RunOnce>'


def tree(name):
    return f'<SubTree ID="{name}"/>'


def content(name):
    return TOUR.partition(f'<BehaviorTree ID="{name}">')[2].partition("</BehaviorTree>")[0]


def as_fallback(name):
    """Return the change that makes the outermost Sequence of a tree a Fallback."""
    old = content(name)
    assert old.startswith("<Sequence>") and old.endswith("</Sequence>")
    return old, "<Fallback>" + old[len("<Sequence>"):-len("</Sequence>")] + "</Fallback>"


GAZE, DRIVE = tree("AwaitMutualGaze"), tree("NavigateToLocation")
OFF, STILL = safe("DisabledOvertAttentionMode"), safe("DisableAnimateBehavior")
TO_DRIVE = "<DisabledOvertAttentionMode/>", "<DisableAnimateBehavior/>", "<Navigate/>"
FIRST = safe('DescribeExhibitSpeech name="1" _description="description1, before pointing"')
SECOND = safe('DescribeExhibitSpeech name="2" _description="description2, after pointing"')
START = """<START_OF_TREE _onSuccess="@tourBrokenOff := 'no'"/>"""
QUERY, ANSWER = tree("QueryVisitorResponse"), "<IsVisitorResponseYes/>"
DECLINED = f"<Inverter>{ANSWER}</Inverter>"
PROMPT = safe("SayYesNoSpeech") + tree("HearYesNo")
GOODBYES = safe("GoodbyeGesture") + safe("SayGoodByeSpeech")
PARALLEL = f'<Parallel success_count="2" failure_count="1">{GOODBYES}</Parallel>'
LOOK = f'<Fallback name="SomebodyToSayGoodbyeTo">{GAZE}<IsVisitorDiscovered/></Fallback>'
POINT = safe('PerformDeicticGesture name="Point to exhibit"')
WELCOME = safe("WelcomeSpeech")
ASK = safe("QueryTourSpeech")
STOP = f"""<Fallback>{tree("VisitExhibit")}<HandleFallBack _onFailure="@tourBrokenOff := 'yes'"/>\
</Fallback>"""
RETRIES = ('<RetryUntilSuccessful name="AtMostThreePrompts" num_attempts="3">' + steps(PROMPT)
           + "</RetryUntilSuccessful>")
COUNTED = '<ScriptCondition code="@prompts &lt; 3"/><Script code="@prompts += 1"/>'

CALM = ["asrEnabled:=true", "--faults", "none"]


def calm(visitors="engages", *words):
    return [*CALM, "--visitors", visitors, *words]


def planned(fault, *words):
    """Return the words for the one play that shows the mistake: a rehearsal with every fault needs a
    hundred."""
    return ["asrEnabled:=true", "--visitors", "engages", "--planned", fault + ":refused", *words]


FLAWED = [
    # what the visitor before leaves behind
    ("the list is retrieved once", calm("engages,noGaze"), "next-visitor",
     [(safe("RetrieveListOfExhibits"), once(safe("RetrieveListOfExhibits")))]),
    ("only the first is greeted", calm("engages,noGaze"), "next-visitor",
     [(WELCOME, once(WELCOME))]),
    ("only the first is asked", calm("engages,noGaze"), "next-visitor", [(ASK, once(ASK))]),
    ("a counter of prompts is never reset", calm("engages,silent"), "next-visitor",
     [(START, START + once('<Script code="@prompts := 0"/>')), (PROMPT, COUNTED + PROMPT)]),
    ("the answer of the visitor before", calm("engages,declines"), "next-visitor",
     [(START, START + once("<Script code=\"@said := 'none'\"/>")),
      (f'<Sequence name="Accepted">{ANSWER}',
       '<Sequence name="Accepted"><Script code="@said := \'yes\'" _skipIf="@visitorResponse != '
       '\'yes\'"/><ScriptCondition code="@said == \'yes\'"/>')]),
    ("a tour that was broken off is remembered", calm("engages,leaves"), "next-visitor",
     [(START, "<START_OF_TREE/>" + once("<Script code=\"@tourBrokenOff := 'no'\"/>"))]),
    ("a failure is remembered", planned("textToSpeech:1", "--then", "engages"), "next-visitor",
     [(START, START + once('<Script code="@mute := 0"/>')),
      (WELCOME, '<Fallback _skipIf="@mute == 1"><WelcomeSpeech/>'
                '<Script code="@mute := 1"/></Fallback>')]),
    ("the third visitor is not greeted", calm("engages,noGaze"), "next-visitor",
     [(START, START + once('<Script code="@met := 0"/>') + '<Script code="@met += 1"/>'),
      (WELCOME, f'<ForceSuccess _skipIf="@met == 3">{WELCOME}</ForceSuccess>')]),
    # a recovery around a step that matters
    ("a recovery around the drive", planned("animateBehavior:9"), "left-out-step",
     [(OFF + STILL + safe("Navigate"),
       f"<Fallback>{steps(*TO_DRIVE)}{H}</Fallback>")]),
    ("a recovery around the greeting", planned("gestureExecution:1"), "left-out-step",
     [(safe("WelcomeGesture"), ""), (STILL + safe("EnableAnimateBehavior"), ""), (
         WELCOME, f"<Fallback>{steps('<WelcomeGesture/>', '<WelcomeSpeech/>')}{H}</Fallback>")]),
    ("a failed gesture leaves out the words", planned("gestureExecution:8"), "left-out-step",
     [(PARALLEL, "<ForceSuccess>" + steps("<GoodbyeGesture/>", "<SayGoodByeSpeech/>")
       + "</ForceSuccess>")]),
    ("a failed gesture leaves out the second description", planned("gestureExecution:2"),
     "left-out-step",
     [(POINT + safe("SocialOvertAttentionMode") + SECOND, "<ForceSuccess>" + steps(
         '<PerformDeicticGesture/>', '<DescribeExhibitSpeech name="2"/>') + "</ForceSuccess>")]),
    ("the goodbye is left out when seeking fails", planned("overtAttention:25+"), "no-goodbye",
     [(LOOK, "<ForceSuccess>" + steps(GAZE, safe("HereIsTheDoorSpeech"), PARALLEL)
       + "</ForceSuccess>"),
      (safe("EndTourSpeech"), ""),
      (safe("HereIsTheDoorSpeech") + safe('PerformDeicticGesture name="Point to exit"') + PARALLEL,
       "")]),
    # what is said and done
    ("the declined branch does not look at the answer", calm("leaves"), "speech-to-nobody",
     [(DECLINED, "")]),
    ("the declined branch asks for a yes", calm("leaves"), "speech-to-nobody",
     [(DECLINED, ANSWER)]),
    ("the first description twice", calm(), "said-twice",
     [(SECOND, safe('DescribeExhibitSpeech name="1"'))]),
    ("the second description twice", calm(), "said-twice",
     [(FIRST, safe('DescribeExhibitSpeech name="2"'))]),
    ("drives with attention on", calm(), "drives-switched-on", [(OFF, "")]),
    ("drives with lifelike movement on", calm(), "drives-switched-on", [(STILL, "")]),
    ("attention is left on", calm(), "left-on",
     [(tree("GoHome") + "</Sequence><Force",
       tree("GoHome") + safe("SocialOvertAttentionMode") + "</Sequence><Force")]),
    ("the answer is used before the question", calm(), "answer-mixed-up",
     [(QUERY, ""), ("</Fallback></Sequence></Fallback></Sequence></BehaviorTree>"
                    '<BehaviorTree ID="DetectVisitor">',
                    "</Fallback></Sequence></Fallback>" + QUERY + "</Sequence></BehaviorTree>"
                    '<BehaviorTree ID="DetectVisitor">')]),
    ("the answer is waited for before the question", calm(), "answer-mixed-up",
     [(ASK, ""), ('</ForceSuccess></Sequence></BehaviorTree><BehaviorTree ID="HearYesNo">',
                  '</ForceSuccess>' + ASK + '</Sequence></BehaviorTree>'
                  '<BehaviorTree ID="HearYesNo">')]),
    ("prompts are repeated and not retried",
     ["asrEnabled:=true", "--kinds", "exception", "--visitors", "declines"], "asked-again",
     [(RETRIES, f'<Repeat num_cycles="3">{steps(PROMPT)}</Repeat>')]),
    # around the loop of the stops
    ("the stops are pointed at after the loop", calm(), "not-shown",
     [(POINT, ""), (tree("VisitExhibits"), tree("VisitExhibits") + POINT)]),
    ("the second description stands after the loop", calm(), "not-shown",
     [(SECOND, ""), (safe("EndTourSpeech"), SECOND + safe("EndTourSpeech"))]),
    ("the tour goes on when the visitor has left", calm("leaves"), "unwanted-drive",
     [(STOP, f"<ForceSuccess>{STOP}</ForceSuccess>")]),
    ("the tour begins anew when the visitor has left", calm("leaves"), "unwanted-drive",
     [(tree("VisitExhibits"), '<RetryUntilSuccessful num_attempts="2">' + tree("VisitExhibits")
       + "</RetryUntilSuccessful>")]),
    ("a whole tour counts as broken off", calm(), "no-goodbye",
     [("""code="@tourBrokenOff == 'no'\"""", """code="@tourBrokenOff == 'yes'\"""")]),
    # a Fallback for a Sequence
    ("a Fallback of the steps of a drive", ["--faults", "none"], "never-asked",
     [as_fallback("NavigateToLocation")]),
    ("a Fallback of the steps of a stop", calm(), "not-shown", [as_fallback("VisitExhibit")]),
    ("a Fallback of the steps at the end", ["--faults", "none"], "never-asked",
     [as_fallback("EndTour")]),
    ("a Fallback of the tour", ["--faults", "none"], "never-asked",
     [as_fallback("VisitExhibits")]),
    ("a Fallback of the mission", ["--faults", "none"], "never-asked",
     [as_fallback("LabTour")]),
    ("a Fallback of the way home", calm(), "not-home", [as_fallback("GoHome")])]

SOUND = [
    ("pointing before describing", [(FIRST + POINT, POINT + FIRST)]),
    ("one description alone", [(SECOND, "")]),
    ("no gesture of welcome", [(safe("WelcomeGesture"), "")]),
    ("two prompts", [('name="AtMostThreePrompts" num_attempts="3"',
                      'name="AtMostThreePrompts" num_attempts="2"')]),
    ("goodbye in words, then by a gesture", [(PARALLEL, safe("SayGoodByeSpeech")
                                              + safe("GoodbyeGesture"))]),
    ("a counter that each visitor resets",
     [(START, START + '<Script code="@prompts := 0"/>'), (PROMPT, COUNTED + PROMPT)])]


def changed(changes):
    text = TOUR
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text

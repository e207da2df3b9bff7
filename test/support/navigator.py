"""A navigator as robots have it: a palette of 60 node types of its own, and 15 trees that use them,
as Groot2 files."""
import os
from xml.sax.saxutils import quoteattr

# kind, name, ports: ``>p`` is read, ``p>`` written, ``>p>`` both; ``=text`` after it is the default
PALETTE = """
Action PlanPath >goal >start >planner path> error> duration>
Action PlanPathThrough >goals >start >planner path> error>
Action PlanRoute >start_id >goal_id >use_poses route> path> error>
Action FollowPath >path >controller >goal_checker error>
Action FollowRoute >route >path error>
Action SmoothPath >unsmoothed smoothed> >smoother >limit=2.5 ended_early>
Action TruncatePath >input output> >distance=1.0
Action TruncatePathLocally >input output> >ahead >behind >frame
Action ClearWholeCostmap >service
Action ClearCostmapAround >service >reset_distance=1
Action ClearCostmapExcept >service >reset_distance=1
Action SpinInPlace >angle=1.57 >allowance >is_recovery error>
Action BackUp >distance=0.3 >speed=0.05 >allowance error>
Action DriveStraight >distance=0.5 >speed=0.1 >allowance error>
Action WaitFor >seconds=1.0
Action AssistedTeleop >is_recovery >allowance error>
Action CancelControl >server
Action CancelSpin >server
Action CancelBackUp >server
Action Relocalise >service
Action SelectPlanner >topic >default=Grid selected>
Action SelectController >topic >default=Pursuit selected>
Action SelectSmoother >topic >default=Simple selected>
Action SelectGoalChecker >topic >default=General selected>
Action SelectProgressChecker >topic >default=Simple selected>
Action RemovePassedGoals >goals remaining> >radius=0.7
Action RemoveGoalsInCollision >goals remaining> >threshold=254
Action GetPoseFromPath >path >index=0 pose>
Action GetCurrentPose >frame pose>
Action ConcatenatePaths >first >second output>
Action DockRobot >dock_id >use_id >staging success> error>
Action UndockRobot >dock_type success> error>
Action Charge >until=0.9
Action AppendGoal >goal >goals output>
Action NextGoal >>goals>> goal>
Action SetSpeedLimit >percent=100
Action Log >message
Action PlaySound >file
Condition GoalReached >goal >frame
Condition GoalUpdated
Condition GoalsUpdated
Condition InitialPoseReceived
Condition IsStuck
Condition IsStopped >duration=1.0
Condition IsPathValid >path >max_cost=253
Condition PathExpired >path >seconds
Condition TransformAvailable >child >parent
Condition DistanceTravelled >distance=1.0
Condition TimePassed >seconds=1.0
Condition BatteryLow >topic >minimum=0.2 >is_voltage
Condition BatteryCharging >topic
Condition PlannerMayRecover >error
Condition ControllerMayRecover >error
Condition SmootherMayRecover >error
Control RecoverAndRetry >attempts=1
Control Pipeline
Control RoundRobin
Decorator AtRate >hertz=10
Decorator PerDistance >distance=1.0
Decorator WhenGoalUpdates
""".split("\n")[1:-1]

CLEAR = '<ClearWholeCostmap name="{0}" service="{0}_costmap/clear"/>'
REPLAN = """<AtRate hertz="1.0">
      <RecoverAndRetry attempts="1" name="Plan">
        <PlanPath goal="{goal}" path="{path}" planner="{selected_planner}" error="{plan_error}"/>
        <Sequence>
          <PlannerMayRecover error="{plan_error}"/>
          """ + CLEAR.format("global") + """
        </Sequence>
      </RecoverAndRetry>
    </AtRate>"""
FOLLOW = """<RecoverAndRetry attempts="1" name="Follow">
      <FollowPath path="{path}" controller="{selected_controller}" error="{follow_error}"/>
      <Sequence>
        <ControllerMayRecover error="{follow_error}"/>
        """ + CLEAR.format("local") + """
      </Sequence>
    </RecoverAndRetry>"""
RECOVERIES = """<ReactiveFallback name="Recoveries">
      <GoalUpdated/>
      <RoundRobin name="Actions">
        <Sequence name="Clearing">
          """ + CLEAR.format("local") + CLEAR.format("global") + """
        </Sequence>
        <SpinInPlace angle="1.57" error="{spin_error}"/>
        <WaitFor seconds="5.0"/>
        <BackUp distance="0.30" speed="0.15" error="{back_up_error}"/>
      </RoundRobin>
    </ReactiveFallback>"""
SELECTORS = """<SelectController selected="{selected_controller}" default="Pursuit" topic="controller"/>
      <SelectPlanner selected="{selected_planner}" default="Grid" topic="planner"/>"""


def with_recovery(inside):
    return ('<RecoverAndRetry attempts="6" name="Navigate">\n    {}\n    {}\n  </'
            'RecoverAndRetry>'.format(inside, RECOVERIES))


def pipeline(*parts):
    return "<Pipeline>\n      {}\n    </Pipeline>".format("\n      ".join(parts))


TREES = {
    "to_pose":
        with_recovery(pipeline(SELECTORS, REPLAN, FOLLOW)),
    "to_pose_by_distance":
        with_recovery(
            pipeline(
                SELECTORS,
                REPLAN.replace('AtRate hertz="1.0"',
                               'PerDistance distance="1.0"').replace("</AtRate>", "</PerDistance>"),
                FOLLOW)),
    "to_pose_when_updated":
        with_recovery(
            pipeline(SELECTORS, "<WhenGoalUpdates>" + REPLAN + "</WhenGoalUpdates>", FOLLOW)),
    "through_poses":
        with_recovery(
            pipeline(
                SELECTORS, """<AtRate hertz="0.333"><ReactiveSequence>
        <RemovePassedGoals goals="{goals}" remaining="{goals}" radius="0.7"/>
        <PlanPathThrough goals="{goals}" path="{path}" planner="{selected_planner}" error="{plan_error}"/>
      </ReactiveSequence></AtRate>""", FOLLOW)),
    "smoothed":
        with_recovery(
            pipeline(
                SELECTORS, '<SelectSmoother selected="{smoother}" topic="smoother"/>', REPLAN,
                """<Sequence>
        <SmoothPath unsmoothed="{path}" smoothed="{path}" smoother="{smoother}"/></Sequence>""",
                FOLLOW)),
    "only_plan":
        '<PlanPath goal="{goal}" path="{path}" planner="Grid"/>',
    "follow_point":
        """<Pipeline><AtRate hertz="1.0"><Sequence>
      <WhenGoalUpdates><PlanPath goal="{updated_goal}" path="{path}" planner="Grid"/></WhenGoalUpdates>
      <TruncatePath distance="1.0" input="{path}" output="{truncated_path}"/>
    </Sequence></AtRate>
    <KeepRunningUntilFailure><FollowPath path="{truncated_path}" controller="Pursuit"/></KeepRunningUntilFailure>
  </Pipeline>""",
    "recoveries_only":
        RECOVERIES,
    "route":
        with_recovery(
            pipeline("""<Sequence>
        <PlanRoute goal_id="4" route="{route}" path="{path}" error="{route_error}" _onSuccess="planned := true"/>
        <FollowRoute route="{route}" path="{path}"/></Sequence>""")),
    "dock":
        """<Sequence>
    <GetCurrentPose frame="map" pose="{pose}"/>
    <DockRobot dock_id="{dock}" use_id="true" error="{dock_error}"/>
    <Fallback><BatteryCharging topic="battery"/><Charge until="0.95"/></Fallback>
    <UndockRobot dock_type="{dock_type}" _skipIf="stay_docked == true"/>
  </Sequence>""",
    "patrol":
        """<Sequence>
    <Repeat num_cycles="3"><Sequence>
      <NextGoal goals="{goals}" goal="{next}"/>
      <SubTree ID="Drive" goal="{next}" _autoremap="true"/>
    </Sequence></Repeat>
    <Log message="done"/>
  </Sequence>""",
    "guarded":
        """<ReactiveSequence>
    <Inverter><BatteryLow topic="battery" minimum="0.2"/></Inverter>
    <Fallback><GoalReached goal="{goal}" frame="base"/>{}</Fallback>
  </ReactiveSequence>""".replace("{}", pipeline(REPLAN, FOLLOW)),
    "timed":
        '<Timeout msec="60000">' + pipeline(REPLAN, FOLLOW) + "</Timeout>",
    "cancelling":
        """<ReactiveSequence>
    <Inverter><PathExpired path="{path}" seconds="10"/></Inverter>
    <IfThenElse><IsPathValid path="{path}"/><FollowPath path="{path}"/><CancelControl/></IfThenElse>
  </ReactiveSequence>""",
    "speeds":
        """<Sequence>
    <Script code="speed := 50; tries := 0"/>
    <RetryUntilSuccessful num_attempts="3"><Sequence>
      <Script code="tries += 1; speed /= 2"/>
      <SetSpeedLimit percent="{speed}"/>
      <DriveStraight distance="0.5" error="{drive_error}" _failureIf="tries &gt; 2 &amp;&amp; speed &lt; 10"/>
    </Sequence></RetryUntilSuccessful>
  </Sequence>"""}
DRIVE = '\n  <BehaviorTree ID="Drive">\n    ' + pipeline(REPLAN, FOLLOW) + "\n  </BehaviorTree>"


def palette():
    """Return the palette's file."""
    lines = ["<root>", "  <TreeNodesModel>"]
    for line in PALETTE:
        kind, name, *ports = line.split()
        lines.append('    <{} ID="{}">'.format(kind, name))
        for port in ports:
            port, _, default = port.partition("=")
            tag = "inout_port" if port[0] + port[-1] == ">>" else "input_port" if port[
                0] == ">" else "output_port"
            lines.append("      <{0} name={1}{2}>the {3} of it</{0}>".format(
                tag, quoteattr(port.strip(">")),
                " default=" + quoteattr(default) if default else "", port.strip(">")))
        lines.append("    </{}>".format(kind))
    return "\n".join(lines + ["  </TreeNodesModel>", "</root>", ""])


def tree(name):
    """Return the file of one of the trees."""
    return ('<root BTCPP_format="4" main_tree_to_execute="MainTree">\n  <BehaviorTree '
            'ID="MainTree">'
            '\n  {}\n  ' \
           "</BehaviorTree>{}\n</root>\n".format(TREES[name], DRIVE if name == "patrol" else ""))


def write(folder):
    """Write palette and trees into a folder; return the path of the palette and those of the trees.
    """
    paths = {"palette": palette()}
    paths.update((name, tree(name)) for name in TREES)
    for name, text in paths.items():
        with open(os.path.join(str(folder), name + ".xml"), "w", encoding="utf-8") as file:
            file.write(text)
    return os.path.join(
        str(folder), "palette.xml"), [os.path.join(str(folder), name + ".xml") for name in TREES]

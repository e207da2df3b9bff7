# Completion of rosrun for these packages: their commands and nodes, and what each of them reads. What rosbash completes
# stays as it is.
_cssr_system_words() { # PACKAGE [COMMAND]
  case "$1 ${2-}" in
    # derived: words
    "cssr_system ") echo behaviorController exportNodeModel missionStatus missionViewer rehearseMission replayMission tryRobot validateMission ;;
    "cssr_system behaviorController") echo --help --version _scenarioSpecification:= _verboseMode:= _asrEnabled:= _robotInterface:= _robot:= _tabletSuccessIs:= _waitForSpeech:= _speechPace:= _language:= _missionRuns:= _startupTimeout:= _startupCheck:= _topicMaxAge:= _conditionWait:= _mutualGazeValue:= _welcomeGestureId:= _goodbyeGestureId:= _deicticGestureId:= _gestureDuration:= _groot2Port:= _groot2Address:= _monitorPort:= _monitorAddress:= _rosInterface:= _startBy:= _recordDirectory:= _animateBehaviorDeadline:= _gestureExecutionDeadline:= _knowledgeBaseDeadline:= _overtAttentionDeadline:= _robotNavigationDeadline:= _tabletEventDeadline:= _textToSpeechDeadline:= _robotLocalizationDeadline:= _speechEventDeadline:= ;;
    "cssr_system exportNodeModel") echo --help --version --project ;;
    "cssr_system missionStatus") echo --help --version --watch --all --ready --address --robot --port ;;
    "cssr_system missionViewer") echo --help --version --address --port --groot2 --groot2 --records ;;
    "cssr_system rehearseMission") echo --help --version --faults --visitors --kinds --planned --silent --quick --then --runs --failureRate --seed --limit --jobs --list --json --html scenarioSpecification:= verboseMode:= asrEnabled:= robotInterface:= robot:= tabletSuccessIs:= waitForSpeech:= speechPace:= language:= missionRuns:= startupTimeout:= startupCheck:= topicMaxAge:= conditionWait:= mutualGazeValue:= welcomeGestureId:= goodbyeGestureId:= deicticGestureId:= gestureDuration:= groot2Port:= groot2Address:= monitorPort:= monitorAddress:= rosInterface:= startBy:= recordDirectory:= animateBehaviorDeadline:= gestureExecutionDeadline:= knowledgeBaseDeadline:= overtAttentionDeadline:= robotNavigationDeadline:= tabletEventDeadline:= textToSpeechDeadline:= robotLocalizationDeadline:= speechEventDeadline:= ;;
    "cssr_system replayMission") echo --help --version --mission --report --story --runs --json ;;
    "cssr_system tryRobot") echo --help --version ;;
    "cssr_system validateMission") echo --help --version --json --main --palette --interface --folder --ignore --watch ;;
    "unit_tests ") echo animateBehavior faceDetection gestureExecution knowledgeBase overtAttention robotLocalization robotNavigation runTest simulatedClock speechEvent tabletEvent textToSpeech ;;
    "unit_tests animateBehavior" | "unit_tests faceDetection" | "unit_tests gestureExecution" | "unit_tests knowledgeBase" | "unit_tests overtAttention" | "unit_tests robotLocalization" | "unit_tests robotNavigation" | "unit_tests speechEvent" | "unit_tests tabletEvent" | "unit_tests textToSpeech") echo --help --version _failureRate:= _arrivalRate:= _verboseMode:= _visitorBehaviour:= _missionRuns:= _randomSeed:= _faultKinds:= _plannedFaults:= _recogniseBy:= _absentServices:= _absentActions:= _quickNodes:= _callTimes:= _testTimeout:= ;;
    "unit_tests runTest") echo --help --version failureRate:= arrivalRate:= verboseMode:= visitorBehaviour:= missionRuns:= randomSeed:= faultKinds:= plannedFaults:= recogniseBy:= absentServices:= absentActions:= quickNodes:= callTimes:= testTimeout:= scenarioSpecification:= asrEnabled:= robotInterface:= robot:= tabletSuccessIs:= waitForSpeech:= speechPace:= language:= startupTimeout:= startupCheck:= topicMaxAge:= conditionWait:= mutualGazeValue:= welcomeGestureId:= goodbyeGestureId:= deicticGestureId:= gestureDuration:= groot2Port:= groot2Address:= monitorPort:= monitorAddress:= rosInterface:= startBy:= recordDirectory:= animateBehaviorDeadline:= gestureExecutionDeadline:= knowledgeBaseDeadline:= overtAttentionDeadline:= robotNavigationDeadline:= tabletEventDeadline:= textToSpeechDeadline:= robotLocalizationDeadline:= speechEventDeadline:= outputFile:= speed:= use_real_animateBehavior:= use_real_gestureExecution:= use_real_knowledgeBase:= use_real_overtAttention:= use_real_robotNavigation:= use_real_tabletEvent:= use_real_textToSpeech:= use_real_robotLocalization:= use_real_speechEvent:= use_real_faceDetection:= mission:= scenario:= seed:= verbose:= ;;
    "unit_tests simulatedClock") echo --help --version _speed:= ;;
    # derived: end
  esac
}

_cssr_system_complete() {
  local words=""
  COMPREPLY=()
  if [ "$COMP_CWORD" = 2 ]; then
    words="$(_cssr_system_words "${COMP_WORDS[1]}")"
  elif [ "$COMP_CWORD" -gt 2 ]; then
    words="$(_cssr_system_words "${COMP_WORDS[1]}" "${COMP_WORDS[2]}")"
  fi
  if [ -n "$words" ]; then
    COMPREPLY=($(compgen -W "$words" -- "${COMP_WORDS[COMP_CWORD]}"))
    [[ "${COMPREPLY[*]-}" != *= ]] || compopt -o nospace
  else
    if ! declare -F _roscomplete_exe >/dev/null && [ -f /usr/share/bash-completion/completions/rosrun ]; then
      . /usr/share/bash-completion/completions/rosrun
      complete -o default -F _cssr_system_complete rosrun # the file has its own
    fi
    ! declare -F _roscomplete_exe >/dev/null || _roscomplete_exe
  fi
}

complete -o default -F _cssr_system_complete rosrun

# Each target sets up first what it needs; what is there already is skipped.

.PHONY: run seeds unit test test-all setup derived pictures conformance bench soak mutations clean

# the lab tour once, against nine simulated nodes, ten times as fast as on a robot; the exit code tells the verdict.
# ARGS='failureRate:=0.2 speed:=1'
run:
	@tools/run.sh $(ARGS)

# the same once for each of 20 seeds: a line for each run, the reports of those that did not pass, and a sum.
# ARGS='40 failureRate:=0.3'
seeds:
	@tools/seeds.sh $(ARGS)

# those of the tests that take a moment each and need no ROS: about a minute on two cores
unit:
	@tools/test.sh --unit $(ONLY)

# what a change can break: less than 8 minutes on four cores. ONLY=rostest: the tests with that word in their name
test:
	@tools/test.sh $(ONLY)

# after these the tests that take long: every Python, every scenario, leaks, network cuts, faults at every call
test-all: test
	@tools/test.sh --long $(ONLY)

# system packages, virtual environments and the catkin workspace
setup:
	@tools/setup.sh --tests
	@echo 'source $(CURDIR)/build/devel/setup.bash'

# write what follows from declarations: tables of documents, keys of configurations, launch files, executables of simulated nodes
derived:
	@tools/in_workspace.sh python3 tools/derive.py

# run the lab tour and take the pictures of the documents from it: about four minutes
pictures:
	@tools/setup.sh --tests
	@tools/in_workspace.sh python3 tools/pictures.py

# compare the engine with recorded traces. VECTORS: folder of .json, or .jsonl(.xz) file; LEVEL: roots, leaves or full
conformance:
	@test -n '$(VECTORS)' || { echo 'say where the traces are: make conformance VECTORS=test/conformance/hand'; exit 2; }
	@tools/in_workspace.sh python3 test/conformance/harness.py --level $(or $(LEVEL),full) \
	  --may-differ test/conformance/may_differ.json '$(VECTORS)'

# the engine against plain py_trees and lxml
bench:
	@tools/in_workspace.sh python3 bench/bench_engine.py
	@tools/in_workspace.sh python3 bench/bench_runtime.py $(ARGS)
	@tools/in_workspace.sh python3 bench/bench_viewer.py

# the lab tour on the real node with every fault at every call, an adversary around it, and the judge's trials: about 90 minutes.
# ARGS=sweep, pairs, rates, stops, adversary, broken or sound
soak:
	@tools/in_workspace.sh python3 test/soak/soak.py $(ARGS)

# break one place of the code at a time: does a test notice? ARGS='rules', or 'sample --count 50 --seed 2'
mutations:
	@tools/in_workspace.sh python3 test/mutation/run_mutations.py $(ARGS)

clean:
	rm -rf build

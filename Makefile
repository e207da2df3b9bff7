# Each target sets up first what it needs; what is there already is skipped.

.PHONY: run test setup conformance bench mutations clean

run:        ## the lab tour once, against nine simulated nodes; the exit code tells the outcome
	@tools/run.sh

test:       ## every test; ONLY=rostest chooses suites by a word of their name
	@tools/test.sh $(ONLY)

setup:      ## system packages, virtual environments and the catkin workspace
	@tools/setup.sh --tests
	@echo "source $(CURDIR)/build/devel/setup.bash"

conformance: ## compare the engine with recorded traces: VECTORS=folder or .jsonl(.xz) file, LEVEL=roots, leaves or full
	@tools/in_workspace.sh python3 -m behavior_controller.bt.conformance --level $(or $(LEVEL),full) \
	  --may-differ test/conformance/may_differ.json \
	  $(or $(VECTORS),$(error say VECTORS=folder or file of traces, as in test/conformance/hand))

bench:      ## ratios of the engine to plain py_trees and to lxml, measured in one run, as JSON
	@tools/in_workspace.sh python3 bench/bench_engine.py

mutations:  ## break each rule of the engine in turn: the traces and tests must notice every one
	@tools/in_workspace.sh python3 test/mutation/run_mutations.py

clean:      ## everything that was built
	rm -rf build

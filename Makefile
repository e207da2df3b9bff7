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
	  $(or $(VECTORS),$(error say VECTORS=folder or file of traces, as in test/conformance/hand))

clean:      ## everything that was built
	rm -rf build

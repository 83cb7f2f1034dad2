# minimal build target for development; grows below
VENV := .venv
native:
	flock .build.lock $(VENV)/bin/pip install -q --no-build-isolation --no-deps -e .
.PHONY: native

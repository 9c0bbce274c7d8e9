"""``python -m spab_core.cli``: the command ``spab``."""

from spab_core.cli.main import main

raise SystemExit(main())

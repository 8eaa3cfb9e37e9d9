"""`jointplay schema`: print the JSON schema of scenario files, for editors.

Print the JSON schema of scenario files. Saved as scenario.schema.json beside a scenario whose first
line is `#:schema scenario.schema.json`, it gives editors with Taplo (Even Better TOML) completion,
explanations and checks.
"""

import argparse
import sys


def run(options: argparse.Namespace) -> int:
    import json

    from jointplay.scenario.schema import schema

    json.dump(schema(), sys.stdout, indent=1, ensure_ascii=False)
    print()
    return 0

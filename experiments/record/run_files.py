"""Names of the files in a run's folder."""

SCENARIO_FILE = "scenario.yaml"
INFO_FILE = "run.json"
RECORD_FILE = "record.mcap"
CONTROL_FILE = "control.json"
SWEEP_FILE = "sweep.json"
FIGURES_FOLDER = "figures"

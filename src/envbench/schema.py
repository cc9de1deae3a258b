"""The tables of a store, as numbered migrations: what a user's own SQL may rely on.

A store carries the number of its schema in ``PRAGMA user_version``. To change the schema, append one migration; never
edit one that was released, for stores in the field have gone through it.
"""

from __future__ import annotations

APPLICATION = 0x656E7662
"""``PRAGMA application_id`` of a store: "envb"."""

_RUN = """
CREATE TABLE run (
    number INTEGER PRIMARY KEY,      -- grows from run to run
    id TEXT NOT NULL UNIQUE,
    suite TEXT NOT NULL,
    suite_text TEXT NOT NULL,        -- the suite's TOML
    started TEXT NOT NULL,           -- ISO 8601
    machine TEXT NOT NULL,           -- JSON object
    versions TEXT NOT NULL,          -- JSON object
    finished TEXT,                   -- ISO 8601; NULL while the run goes on, or was killed
    wall_seconds REAL,
    overhead_seconds REAL            -- wall time less the stored phases
)"""

_SCENE = """
CREATE TABLE scene (
    id INTEGER PRIMARY KEY,
    run_id TEXT NOT NULL REFERENCES run (id) ON DELETE CASCADE,
    name TEXT NOT NULL,
    light TEXT NOT NULL,
    material TEXT NOT NULL,
    geometry TEXT NOT NULL,
    view TEXT NOT NULL,
    specs TEXT NOT NULL,             -- JSON object: what the four names meant
    effects TEXT NOT NULL,           -- JSON array: what the reference simulates
    points INTEGER NOT NULL,
    reference_key TEXT NOT NULL,     -- content address
    reference_floor REAL,            -- RMS standard error over RMS radiance; absolute where the radiance is zero
    reference_target REAL,
    reference_samples INTEGER NOT NULL,
    reference_replicates INTEGER NOT NULL,
    reference_seconds REAL,
    reference_from_cache INTEGER NOT NULL,
    reference_rms REAL,              -- W sr^-1 m^-2
    notes TEXT NOT NULL,             -- JSON array
    image_height INTEGER,            -- NULL where the points form no image
    image_width INTEGER,
    image BLOB,                      -- reference mean: zlib of little-endian float32 (height, width, 3); NaN: no point
    UNIQUE (run_id, name)
)"""

_CELL = """
CREATE TABLE cell (
    id INTEGER PRIMARY KEY,
    run_id TEXT NOT NULL REFERENCES run (id) ON DELETE CASCADE,
    key TEXT NOT NULL,               -- content address within the plan
    scene TEXT NOT NULL,             -- scene.name
    method TEXT NOT NULL,
    settings TEXT NOT NULL,          -- JSON object
    status TEXT NOT NULL,            -- ok, declined, failed, crashed, timed out, out of memory
    reason TEXT NOT NULL,
    bytes INTEGER NOT NULL,          -- memory kept to shade
    predicted_error REAL,            -- energy error (squared NRMSE) that theory predicts
    description TEXT NOT NULL,       -- JSON object: what the method chose
    lacks TEXT NOT NULL,             -- JSON array: effects of the scene that the method does not simulate
    image_height INTEGER,
    image_width INTEGER,
    image BLOB,                      -- as scene.image
    UNIQUE (run_id, key)
)"""

_TIMING = """
CREATE TABLE timing (
    cell_id INTEGER NOT NULL REFERENCES cell (id) ON DELETE CASCADE,
    phase TEXT NOT NULL,             -- prepare, relight, frame, shade
    first_seconds REAL NOT NULL,     -- first call, kernel compilation included
    median_seconds REAL NOT NULL,    -- over the rounds; the first call where there are none
    rounds TEXT NOT NULL,            -- JSON array: seconds of each interleaved round
    PRIMARY KEY (cell_id, phase)
)"""

_SCORE = """
CREATE TABLE score (
    cell_id INTEGER NOT NULL REFERENCES cell (id) ON DELETE CASCADE,
    metric TEXT NOT NULL,            -- `envbench list metrics` prints the formulae
    value REAL,                      -- NULL: undefined
    low REAL,                        -- 95 % interval; NULL: the metric has none
    high REAL,
    below_floor INTEGER NOT NULL,
    jackknife TEXT NOT NULL,         -- JSON array: leave-one-replicate-out values
    PRIMARY KEY (cell_id, metric)
)"""

_RESULTS = """
CREATE VIEW results AS
SELECT
    run.id AS run, run.suite, cell.scene, scene.light, scene.material, scene.geometry, scene.view,
    cell.method, cell.settings, cell.status, cell.reason,
    nrmse.value AS nrmse, nrmse.low AS nrmse_low, nrmse.high AS nrmse_high, nrmse.below_floor,
    energy.value AS energy_ratio, scene.reference_floor, cell.predicted_error,
    a.median_seconds AS prepare_seconds, b.median_seconds AS relight_seconds,
    c.median_seconds AS frame_seconds, d.median_seconds AS shade_seconds, cell.bytes
FROM cell
JOIN run ON run.id = cell.run_id
LEFT JOIN scene ON scene.run_id = cell.run_id AND scene.name = cell.scene
LEFT JOIN score AS nrmse ON nrmse.cell_id = cell.id AND nrmse.metric = 'nrmse'
LEFT JOIN score AS energy ON energy.cell_id = cell.id AND energy.metric = 'energy_ratio'
LEFT JOIN timing AS a ON a.cell_id = cell.id AND a.phase = 'prepare'
LEFT JOIN timing AS b ON b.cell_id = cell.id AND b.phase = 'relight'
LEFT JOIN timing AS c ON c.cell_id = cell.id AND c.phase = 'frame'
LEFT JOIN timing AS d ON d.cell_id = cell.id AND d.phase = 'shade'
ORDER BY run.number, cell.id"""

_MATERIAL = """
CREATE TABLE material (
    id INTEGER PRIMARY KEY,
    run_id TEXT NOT NULL REFERENCES run (id) ON DELETE CASCADE,
    name TEXT NOT NULL,
    sheet TEXT NOT NULL,             -- JSON object: the fields of envbench.records.MaterialSheet
    UNIQUE (run_id, name)
)"""

_STUDY = """
CREATE TABLE study (
    id INTEGER PRIMARY KEY,
    run_id TEXT NOT NULL REFERENCES run (id) ON DELETE CASCADE,
    name TEXT NOT NULL,
    study TEXT NOT NULL,             -- JSON object: the fields of envbench.records.Study
    UNIQUE (run_id, name)
)"""

_ANIMATION = """
CREATE TABLE animation (
    id INTEGER PRIMARY KEY,
    run_id TEXT NOT NULL REFERENCES run (id) ON DELETE CASCADE,
    name TEXT NOT NULL,
    caption TEXT NOT NULL,
    mime TEXT NOT NULL,              -- of data, e.g. image/webp
    data BLOB NOT NULL,              -- one looped picture; empty where there is a reason
    notes TEXT NOT NULL,             -- JSON array
    seconds REAL,
    reason TEXT NOT NULL,            -- why there is no picture
    UNIQUE (run_id, name)
)"""

_PICTURE = """
CREATE TABLE picture (
    id INTEGER PRIMARY KEY,
    run_id TEXT NOT NULL REFERENCES run (id) ON DELETE CASCADE,
    study TEXT NOT NULL,             -- study.name
    name TEXT NOT NULL,
    caption TEXT NOT NULL,           -- what it shows, its tone mapping and scale
    png BLOB NOT NULL,
    UNIQUE (run_id, study, name)
)"""

_FIRST_PREDICTION = "(SELECT value FROM json_each(cell.predictions) LIMIT 1) AS predicted_error"

MIGRATIONS: list[tuple[str, ...]] = [
    (f"PRAGMA application_id = {APPLICATION}", _RUN, _SCENE, _CELL, _TIMING, _SCORE, _RESULTS),
    (  # several predictions a cell; hard cases; materials by themselves
        "ALTER TABLE cell ADD COLUMN predictions TEXT NOT NULL DEFAULT '{}'",  # JSON object: energy error by theory
        """UPDATE cell SET predictions = json_object('captured BRDF energy', predicted_error)
           WHERE predicted_error IS NOT NULL""",
        "DROP VIEW results",
        "ALTER TABLE cell DROP COLUMN predicted_error",
        _RESULTS.replace("cell.predicted_error", _FIRST_PREDICTION),
        "ALTER TABLE scene ADD COLUMN knob TEXT NOT NULL DEFAULT ''",  # the hard case that the scene is a step of
        "ALTER TABLE scene ADD COLUMN step INTEGER NOT NULL DEFAULT 0",
        "ALTER TABLE scene ADD COLUMN setting TEXT NOT NULL DEFAULT ''",  # the knob's value at the step
        _MATERIAL,
    ),
    (  # an asset is prepared once for all its scenes
        "ALTER TABLE scene ADD COLUMN position INTEGER NOT NULL DEFAULT 0",  # place in the plan
        "ALTER TABLE timing ADD COLUMN shared INTEGER NOT NULL DEFAULT 0",  # 1: measured on an earlier scene
    ),
    (_STUDY, _ANIMATION),
    (  # pictures of studies; why effects are simulated
        _PICTURE,
        "ALTER TABLE scene ADD COLUMN decisions TEXT NOT NULL DEFAULT '[]'",  # JSON array: envbench.scene.Decision
    ),
]
"""Statements that lead from schema i to schema i + 1."""

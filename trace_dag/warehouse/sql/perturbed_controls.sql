-- Verified crashes with one thing of their reports changed: what came of each changed report.
CREATE TABLE perturbed_controls AS
SELECT *
FROM read_json(
    getvariable('perturbed_files'),
    columns = {
        'rule_set': 'VARCHAR',
        'cohort': 'VARCHAR',
        'key': 'VARCHAR',
        'perturbation': 'VARCHAR',
        'draw': 'INTEGER',
        'seed': 'BIGINT',
        'detail': 'VARCHAR',
        'other_key': 'VARCHAR',
        'final_state': 'VARCHAR',
        'stage_reached': 'VARCHAR',
        'reason': 'VARCHAR',
        'outcome_detail': 'VARCHAR',
        'verified': 'BOOLEAN',
        'grade': 'VARCHAR',
        'support': 'DOUBLE',
        'own_verified': 'BOOLEAN',
        'moved_m': 'DOUBLE',
        'same_street': 'BOOLEAN'
    }
)
ORDER BY cohort, key, perturbation, draw;

COMMENT ON TABLE perturbed_controls IS 'Verdicts on changed reports: the mutation test of the verdict';
COMMENT ON COLUMN perturbed_controls.rule_set IS 'Set of rules it was judged by';
COMMENT ON COLUMN perturbed_controls.cohort IS 'Cohort of the crash';
COMMENT ON COLUMN perturbed_controls.key IS 'Key of the crash whose report was changed';
COMMENT ON COLUMN perturbed_controls.perturbation IS 'What was changed, by name; python -m lab perturbed prints them in words';
COMMENT ON COLUMN perturbed_controls.draw IS 'Number of the random draw, from 0';
COMMENT ON COLUMN perturbed_controls.seed IS 'Seed it was drawn with';
COMMENT ON COLUMN perturbed_controls.detail IS 'What was changed, in words';
COMMENT ON COLUMN perturbed_controls.other_key IS 'Crash whose report was set down at this place';
COMMENT ON COLUMN perturbed_controls.final_state IS 'verified, first_event_only, rejected or failed, as the changed report ends';
COMMENT ON COLUMN perturbed_controls.stage_reached IS 'Stage that ended it, or the last one';
COMMENT ON COLUMN perturbed_controls.reason IS 'Why it was rejected';
COMMENT ON COLUMN perturbed_controls.outcome_detail IS 'The same as a sentence';
COMMENT ON COLUMN perturbed_controls.verified IS 'Whether it is verified; null where nothing was judged: no map covers the place, or a stage failed';
COMMENT ON COLUMN perturbed_controls.grade IS 'Grade of its verdict; null where it has none';
COMMENT ON COLUMN perturbed_controls.support IS 'Support of its verdict, log-likelihood ratio; null where it has none';
COMMENT ON COLUMN perturbed_controls.own_verified IS 'Whether the unchanged simulation is accepted by the changed report, the location left its own';
COMMENT ON COLUMN perturbed_controls.moved_m IS 'Place of the changed report from that of the crash, m';
COMMENT ON COLUMN perturbed_controls.same_street IS 'Whether that place is on a street the report names; null for reports at their own place';

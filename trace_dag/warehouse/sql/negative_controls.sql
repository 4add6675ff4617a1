-- What verdicts accept that they should not: judgements against other reports and of vehicles that come late.
CREATE TABLE negative_controls AS
SELECT *
FROM read_json(
    getvariable('control_files'),
    columns = {
        'cohort': 'VARCHAR',
        'rule_set': 'VARCHAR',
        'kind': 'VARCHAR',
        'crash_kind': 'VARCHAR',
        'key': 'VARCHAR',
        'other_key': 'VARCHAR',
        'reports_differ': 'BOOLEAN',
        'shifted_vehicle': 'INTEGER',
        'shift_s': 'DOUBLE',
        'verified': 'BOOLEAN',
        'reason': 'VARCHAR',
        'detail': 'VARCHAR',
        'contact_distance_m': 'DOUBLE',
        'clock_error_max_positions': 'DOUBLE',
        'direction_error_max_deg': 'DOUBLE',
        'initial_speed_error_max_rel': 'DOUBLE',
        'speeds_kept': 'BOOLEAN'
    }
)
ORDER BY cohort, kind, key, other_key;

COMMENT ON TABLE negative_controls IS 'Verdicts of simulations on reports that they should not match, and on their own';
COMMENT ON COLUMN negative_controls.rule_set IS 'Set of rules it was judged by';
COMMENT ON COLUMN negative_controls.cohort IS 'Cohort compared within';
COMMENT ON COLUMN negative_controls.kind IS 'true (its own report), other_report, shifted (one vehicle or the person late), mirrored (the person from the other side), dropped (one contact), swapped (two contacts), parked_moved (the parked vehicle 3 m aside) or object_moved (what was struck, farther off than allowed)';
COMMENT ON COLUMN negative_controls.crash_kind IS 'Kind of the crash that was simulated';
COMMENT ON COLUMN negative_controls.key IS 'Key of the crash that was simulated';
COMMENT ON COLUMN negative_controls.other_key IS 'Key of the crash whose report it was judged against';
COMMENT ON COLUMN negative_controls.reports_differ IS 'Whether the two reports contradict each other in an impact or a direction';
COMMENT ON COLUMN negative_controls.shifted_vehicle IS 'Party that came late or from the other side: a vehicle, or 1000 and the number of a person';
COMMENT ON COLUMN negative_controls.shift_s IS 'How late, s';
COMMENT ON COLUMN negative_controls.verified IS 'Whether it is verified; null where the control does not apply';
COMMENT ON COLUMN negative_controls.reason IS 'Why not';
COMMENT ON COLUMN negative_controls.detail IS 'The same as a sentence';
COMMENT ON COLUMN negative_controls.contact_distance_m IS 'First contact to the reported location, m';
COMMENT ON COLUMN negative_controls.clock_error_max_positions IS 'Impact to the reported area, the worse vehicle, hours';
COMMENT ON COLUMN negative_controls.direction_error_max_deg IS 'Turn or angle of approach against the report, the worst, degrees';
COMMENT ON COLUMN negative_controls.initial_speed_error_max_rel IS 'Initial against reported speed, the worse vehicle, relative';
COMMENT ON COLUMN negative_controls.speeds_kept IS 'Whether every reported speed is within the threshold, beyond the criteria of the paper; null if none is reported';

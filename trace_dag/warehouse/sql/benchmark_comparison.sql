-- Our crashes beside a published benchmark's of the same cases, simulated and judged alike.
CREATE TABLE benchmark_comparison AS
SELECT *
FROM read_json(
    getvariable('comparison_files'),
    columns = {
        'cohort': 'VARCHAR',
        'rule_set': 'VARCHAR',
        'key': 'VARCHAR',
        'benchmark': 'VARCHAR',
        'contact': 'BOOLEAN',
        'contact_distance_m': 'DOUBLE',
        'within_distance': 'BOOLEAN',
        'clock_error_max_positions': 'DOUBLE',
        'clocks_ok': 'BOOLEAN',
        'direction_error_max_deg': 'DOUBLE',
        'initial_speed_error_max_rel': 'DOUBLE',
        'speeds_kept': 'BOOLEAN',
        'accepted': 'BOOLEAN',
        'reason': 'VARCHAR'
    }
)
ORDER BY cohort, key, benchmark;

COMMENT ON TABLE benchmark_comparison IS 'The published scenarios and ours of the same crashes, simulated and judged alike';
COMMENT ON COLUMN benchmark_comparison.rule_set IS 'Set of rules it was judged by';
COMMENT ON COLUMN benchmark_comparison.cohort IS 'Cohort the crash belongs to';
COMMENT ON COLUMN benchmark_comparison.key IS 'Key of the crash';
COMMENT ON COLUMN benchmark_comparison.benchmark IS 'published, or trace-dag';
COMMENT ON COLUMN benchmark_comparison.contact IS 'Whether the vehicles touched';
COMMENT ON COLUMN benchmark_comparison.contact_distance_m IS 'First contact to the reported location, m';
COMMENT ON COLUMN benchmark_comparison.within_distance IS 'Whether that is within the threshold';
COMMENT ON COLUMN benchmark_comparison.clock_error_max_positions IS 'Impact to the reported area, the worse vehicle, hours';
COMMENT ON COLUMN benchmark_comparison.clocks_ok IS 'Whether every reported impact is met within the threshold';
COMMENT ON COLUMN benchmark_comparison.direction_error_max_deg IS 'Turn or angle of approach against the report, the worst, degrees';
COMMENT ON COLUMN benchmark_comparison.initial_speed_error_max_rel IS 'Initial against reported speed, the worse vehicle, relative';
COMMENT ON COLUMN benchmark_comparison.speeds_kept IS 'Whether both are within the threshold; null unless both are reported';
COMMENT ON COLUMN benchmark_comparison.accepted IS 'Whether the verdict accepts it';
COMMENT ON COLUMN benchmark_comparison.reason IS 'Why not';

-- Every verdict in one row: the figures of its criteria, the worse vehicle where there is one per vehicle.
CREATE VIEW verdicts AS
SELECT
    key,
    any_value(accepted) AS accepted,
    any_value(value) FILTER (criterion = 'reported_distance') AS contact_distance_m,
    max(value) FILTER (criterion = 'clock_error') AS clock_error_max_positions,
    bool_and(passed) FILTER (reason = 'wrong_direction') AS direction_ok,
    max(abs(value)) FILTER (criterion = 'initial_speed_error') AS speed_error_initial_max_rel,
    max(abs(value)) FILTER (criterion = 'impact_speed_error') AS speed_error_impact_max_rel,
    any_value(hypothesis) AS hypothesis,
    any_value(rule_set) AS rule_set,
    any_value(value) FILTER (criterion = 'closing_speed') AS closing_speed_mps,
    any_value(value) FILTER (criterion = 'approach_angle') AS approach_angle_deg,
    max(value) FILTER (criterion = 'delta_v') AS delta_v_max_mps,
    count(*) FILTER (reason IS NOT NULL AND passed IS NULL) AS criteria_not_evaluated,
    any_value(grade) AS grade,
    any_value(support) AS support,
    any_value(independent_facts) AS independent_facts,
    any_value(support_detail) AS support_detail,
    any_value(value) FILTER (criterion IN ('contact_distance', 'station_distance')) AS judged_distance_m,
    any_value(maps.moved_m) AS moved_m,
    any_value(told.events_reported) AS events_reported,
    any_value(told.events_happened) AS events_happened,
    any_value(told.events_not_modelled) AS events_not_modelled,
    any_value(alternatives) AS alternatives,
    any_value(direction_open) AS direction_open,
    any_value(label) AS label
FROM verdict_criteria
LEFT JOIN maps USING (key)
LEFT JOIN (
    SELECT
        key,
        count(outcome) AS events_reported,
        count(*) FILTER (outcome = 'happened') AS events_happened,
        count(*) FILTER (outcome = 'not_modelled') AS events_not_modelled
    FROM events
    GROUP BY key
) AS told USING (key)
GROUP BY key
ORDER BY key;

COMMENT ON VIEW verdicts IS 'Every verdict in one row';
COMMENT ON COLUMN verdicts.key IS 'Key of the crash';
COMMENT ON COLUMN verdicts.accepted IS 'Whether the first reported event happens as reported';
COMMENT ON COLUMN verdicts.label IS 'What happens: verified (all reported that can be modelled), first_event_only or rejected';
COMMENT ON COLUMN verdicts.grade IS 'Grade: corroborated (enough facts and support, no doubt) or consistent; null for a rejected crash';
COMMENT ON COLUMN verdicts.support IS 'Sum of the weights of all facts of the report, natural logarithm; its rows are in table support';
COMMENT ON COLUMN verdicts.independent_facts IS 'Different facts of the report that agree with the map or the simulated course';
COMMENT ON COLUMN verdicts.support_detail IS 'Why the crash is not corroborated; null if it is';
COMMENT ON COLUMN verdicts.contact_distance_m IS 'First contact, or overturn, from the reported point, m';
COMMENT ON COLUMN verdicts.judged_distance_m IS 'The distance that was judged: along the road for what stands beside it, else the same, m';
COMMENT ON COLUMN verdicts.moved_m IS 'Distance by which the reported point was moved onto a road, m';
COMMENT ON COLUMN verdicts.events_reported IS 'Harmful events of the report';
COMMENT ON COLUMN verdicts.events_happened IS 'Harmful events that happen in the simulation';
COMMENT ON COLUMN verdicts.events_not_modelled IS 'Harmful events that no simulation can have';
COMMENT ON COLUMN verdicts.alternatives IS 'Likely courses beside the judged one: other sides with a quarter or more together; null if there is none';
COMMENT ON COLUMN verdicts.direction_open IS 'Sides that the report leaves open, with the share of each: party, side, share';
COMMENT ON COLUMN verdicts.clock_error_max_positions IS 'Impact against the reported clock position, the worse vehicle, hours';
COMMENT ON COLUMN verdicts.direction_ok IS 'Whether every direction that could be judged is as reported';
COMMENT ON COLUMN verdicts.speed_error_initial_max_rel IS 'Initial speed against the reported one, the worse vehicle, relative; null if none is reported';
COMMENT ON COLUMN verdicts.speed_error_impact_max_rel IS 'Speed at impact against the reported one, the worse vehicle, relative; null if none is reported';
COMMENT ON COLUMN verdicts.hypothesis IS 'Index of the hypothesis that was judged';
COMMENT ON COLUMN verdicts.rule_set IS 'Set of rules it was judged by';
COMMENT ON COLUMN verdicts.closing_speed_mps IS 'Speed at which the vehicles closed, m/s';
COMMENT ON COLUMN verdicts.approach_angle_deg IS 'Angle between their headings at contact, degrees';
COMMENT ON COLUMN verdicts.delta_v_max_mps IS 'Change of velocity, the larger of the vehicles, m/s';
COMMENT ON COLUMN verdicts.criteria_not_evaluated IS 'Criteria that were not evaluated, for lack of a reported value';

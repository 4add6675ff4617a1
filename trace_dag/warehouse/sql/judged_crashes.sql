-- Crashes as a question asks for them: what happened, where, when, how surely, how hard; a row each. The columns of
-- crashes keep their comments.
CREATE VIEW judged_crashes AS
SELECT
    crashes.*,
    verdicts.grade,
    verdicts.direction_open,
    verdicts.contact_distance_m,
    verdicts.delta_v_max_mps,
    verdicts.delta_v_max_mps / 0.44704 AS delta_v_max_mph,
    verdicts.closing_speed_mps,
    verdicts.closing_speed_mps / 0.44704 AS closing_speed_mph,
    verdicts.events_reported,
    verdicts.events_happened,
    limits.speed_limit_mph
FROM crashes
LEFT JOIN verdicts USING (key)
LEFT JOIN (SELECT key, max(speed_limit_mph) AS speed_limit_mph FROM vehicles GROUP BY key) AS limits USING (key);

COMMENT ON VIEW judged_crashes IS 'Every registered crash with grade, change of velocity and speed limit: crashes and verdicts in one';
COMMENT ON COLUMN judged_crashes.grade IS 'Grade: corroborated or consistent; null for a rejected crash';
COMMENT ON COLUMN judged_crashes.direction_open IS 'Sides that the report leaves open, with the share of each: party, side, share';
COMMENT ON COLUMN judged_crashes.contact_distance_m IS 'First contact, or overturn, from the reported point, m';
COMMENT ON COLUMN judged_crashes.delta_v_max_mps IS 'Change of velocity, the larger of the vehicles, m/s';
COMMENT ON COLUMN judged_crashes.delta_v_max_mph IS 'Change of velocity, the larger of the vehicles, mph';
COMMENT ON COLUMN judged_crashes.closing_speed_mps IS 'Speed at which the parties closed at the first contact, m/s';
COMMENT ON COLUMN judged_crashes.closing_speed_mph IS 'The same, mph';
COMMENT ON COLUMN judged_crashes.events_reported IS 'Harmful events of the report';
COMMENT ON COLUMN judged_crashes.events_happened IS 'Harmful events that happen in the simulation';
COMMENT ON COLUMN judged_crashes.speed_limit_mph IS 'Speed limit, the highest of the vehicles, mph';

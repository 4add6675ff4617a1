-- Verified crashes of vehicles that killed somebody, beside what their simulated violence can do. Where the change of
-- velocity says harmless, what killed is not in the simulation: a later event, an overturn, age, no belt. The
-- risk is Joksch's rule of thumb for occupants of cars, (delta-v / 71 mph) to the fourth (Joksch, Velocity Change and
-- Fatality Risk in a Crash, Accident Analysis and Prevention 25, 1993); below 8 km/h no recorder records (49 CFR 563.5).
CREATE VIEW fatality_plausibility AS
WITH violence AS (
    SELECT
        verdicts.key,
        coalesce(max(greatest(contacts.delta_v_1_mps, contacts.delta_v_2_mps)), 0) AS delta_v_mps
    FROM verdicts
    LEFT JOIN contacts ON contacts.key = verdicts.key AND contacts.hypothesis = verdicts.hypothesis
    WHERE verdicts.label = 'verified'
    GROUP BY verdicts.key
),

reported AS (
    SELECT key, count(outcome) AS harmful_events, count(*) FILTER (outcome = 'happened') AS happened
    FROM events
    GROUP BY key
),

fragile AS (  -- who was killed in a car may have been old, or without a belt
    SELECT key, bool_or(driver_age_years >= 65) AS old, bool_or(driver_belted IS FALSE) AS unbelted
    FROM vehicles
    WHERE occupants_killed > 0
    GROUP BY key
),

drawn AS (
    SELECT key, max(high) AS delta_v_high_mps FROM estimate_intervals WHERE quantity = 'delta_v' GROUP BY key
)

SELECT
    key,
    crashes.kind,
    delta_v_mps,
    least((delta_v_mps / (71 * 0.44704)) ** 4, 1) AS fatality_risk,
    delta_v_mps * 3.6 < 8 AS harmless,
    greatest(delta_v_high_mps, delta_v_mps) AS delta_v_high_mps,
    coalesce(harmful_events, 0) AS harmful_events,
    CASE
        WHEN delta_v_mps * 3.6 >= 8 THEN NULL
        WHEN delta_v_high_mps * 3.6 >= 8 THEN 'another course that the report allows, see delta_v_high_mps'
        WHEN crashes.kind = 'overturn' THEN 'the overturn'
        WHEN happened > 1 THEN 'another harmful event, which happens in the simulation'
        WHEN old OR unbelted THEN 'an old or an unbelted driver'
        ELSE 'age, no belt, illness, or a harder impact than the report says'
    END AS explained_by
FROM violence
JOIN crashes USING (key)
LEFT JOIN reported USING (key)
LEFT JOIN drawn USING (key)
LEFT JOIN fragile USING (key)
WHERE crashes.severity = 'K' AND crashes.kind IN ('two_vehicles', 'multi_vehicle', 'parked', 'fixed_object', 'lying_object', 'overturn')
ORDER BY delta_v_mps, key;

COMMENT ON VIEW fatality_plausibility IS 'Verified crashes with deaths in vehicles, and whether their simulated change of velocity can have caused them';
COMMENT ON COLUMN fatality_plausibility.key IS 'Key of the crash';
COMMENT ON COLUMN fatality_plausibility.kind IS 'Kind of crash';
COMMENT ON COLUMN fatality_plausibility.delta_v_mps IS 'Largest change of velocity of any vehicle in any simulated contact, m/s';
COMMENT ON COLUMN fatality_plausibility.fatality_risk IS 'Risk of death of an occupant of a car at that change, 0 to 1 (Joksch 1993)';
COMMENT ON COLUMN fatality_plausibility.harmless IS 'Whether it is below the 8 km/h from which recorders record';
COMMENT ON COLUMN fatality_plausibility.delta_v_high_mps IS 'What one in ten draws of the estimate exceeds, of the same vehicle or another, m/s';
COMMENT ON COLUMN fatality_plausibility.harmful_events IS 'Harmful events that the report lists';
COMMENT ON COLUMN fatality_plausibility.explained_by IS 'Fact of the report that would explain a harmless one; null for others';

-- Pedestrians, each with the vehicle that struck them.
CREATE VIEW pedestrians AS
SELECT
    judged_crashes.key,
    judged_crashes.state_name,
    judged_crashes.place,
    judged_crashes.year,
    judged_crashes.month,
    judged_crashes.day,
    judged_crashes.hour,
    judged_crashes.light,
    judged_crashes.weather,
    person.person_number,
    person.age_years,
    person.sex,
    person.location,
    person.pedestrian_position,
    person.pedestrian_direction,
    person.actions,
    person.striking_vehicle,
    vehicles.vehicle_class,
    vehicles.movement,
    vehicles.speed_limit_mph,
    estimated_states.impact_speed_mps / 0.44704 AS impact_speed_mph,
    judged_crashes.final_state,
    judged_crashes.grade,
    judged_crashes.summary
FROM non_motorists AS person
JOIN judged_crashes USING (key)
LEFT JOIN vehicles ON vehicles.key = person.key AND vehicles.vehicle_number = person.striking_vehicle
LEFT JOIN verdicts ON verdicts.key = person.key
LEFT JOIN estimated_states
    ON estimated_states.key = person.key
    AND estimated_states.vehicle_number = person.striking_vehicle
    AND estimated_states.hypothesis = verdicts.hypothesis
WHERE person.kind = 'pedestrian'
ORDER BY judged_crashes.key, person.person_number;

COMMENT ON VIEW pedestrians IS 'Pedestrians, each with the crash and the vehicle that struck them';
COMMENT ON COLUMN pedestrians.key IS 'Key of the crash, <caseYear>-<stateCase> or <register>-<id>';
COMMENT ON COLUMN pedestrians.state_name IS 'Name of the state';
COMMENT ON COLUMN pedestrians.place IS 'City, county and state as labelled';
COMMENT ON COLUMN pedestrians.year IS 'Year of the crash';
COMMENT ON COLUMN pedestrians.month IS 'Month of the crash';
COMMENT ON COLUMN pedestrians.day IS 'Day of the crash';
COMMENT ON COLUMN pedestrians.hour IS 'Hour of the crash, local time';
COMMENT ON COLUMN pedestrians.light IS 'Light, in words';
COMMENT ON COLUMN pedestrians.weather IS 'Weather, in words';
COMMENT ON COLUMN pedestrians.person_number IS 'Number of the person (PER_NO)';
COMMENT ON COLUMN pedestrians.age_years IS 'Age (AGE, PBAGE)';
COMMENT ON COLUMN pedestrians.sex IS 'Sex, in words';
COMMENT ON COLUMN pedestrians.location IS 'Where the person was, in words (LOCATION)';
COMMENT ON COLUMN pedestrians.pedestrian_position IS 'Position when struck, in words (PEDPOS)';
COMMENT ON COLUMN pedestrians.pedestrian_direction IS 'Direction at an intersection, in words (PEDDIR)';
COMMENT ON COLUMN pedestrians.actions IS 'What the person did before the crash, in words';
COMMENT ON COLUMN pedestrians.striking_vehicle IS 'Number of the vehicle that struck the person (STR_VEH)';
COMMENT ON COLUMN pedestrians.vehicle_class IS 'Kind of body of that vehicle';
COMMENT ON COLUMN pedestrians.movement IS 'Its movement before the critical event, in words (P_CRASH1)';
COMMENT ON COLUMN pedestrians.speed_limit_mph IS 'Its speed limit, mph (VSPD_LIM)';
COMMENT ON COLUMN pedestrians.impact_speed_mph IS 'Its speed at the first contact of the judged course, mph';
COMMENT ON COLUMN pedestrians.final_state IS 'verified, first_event_only, rejected, failed or pending';
COMMENT ON COLUMN pedestrians.grade IS 'Grade: corroborated or consistent; null for a rejected crash';
COMMENT ON COLUMN pedestrians.summary IS 'The crash in words';

-- Crashes as a question asks for them: what happened, where, when, how surely, how hard; a row each.
CREATE VIEW judged_crashes AS
SELECT
    crashes.*,
    verdicts.grade,
    verdicts.direction_open,
    verdicts.contact_distance_m,
    verdicts.delta_v_max_mps,
    verdicts.delta_v_max_mps / 0.44704 AS delta_v_max_mph,
    verdicts.events_reported,
    verdicts.events_happened,
    limits.speed_limit_mph
FROM crashes
LEFT JOIN verdicts USING (key)
LEFT JOIN (SELECT key, max(speed_limit_mph) AS speed_limit_mph FROM vehicles GROUP BY key) AS limits USING (key);

COMMENT ON VIEW judged_crashes IS 'Every registered crash with grade, change of velocity and speed limit: crashes and verdicts in one';
COMMENT ON COLUMN judged_crashes.grade IS 'How well it is supported: corroborated or consistent; null of a rejected crash';
COMMENT ON COLUMN judged_crashes.direction_open IS 'Sides that the report leaves open, with the share of each: party, side, share';
COMMENT ON COLUMN judged_crashes.contact_distance_m IS 'First contact, or overturn, from the reported point, m';
COMMENT ON COLUMN judged_crashes.delta_v_max_mps IS 'Change of velocity, the larger of the vehicles, m/s';
COMMENT ON COLUMN judged_crashes.delta_v_max_mph IS 'Change of velocity, the larger of the vehicles, mph';
COMMENT ON COLUMN judged_crashes.events_reported IS 'Harmful events of the report';
COMMENT ON COLUMN judged_crashes.events_happened IS 'Harmful events that happen in the simulation';
COMMENT ON COLUMN judged_crashes.speed_limit_mph IS 'Speed limit, the highest of the vehicles, mph';
COMMENT ON COLUMN judged_crashes.register IS 'Register that the report is of: fars, or the name of another';
COMMENT ON COLUMN judged_crashes.severity IS 'How badly anybody was hurt, on the KABCO scale: K killed, A, B, C, O not at all';
COMMENT ON COLUMN judged_crashes.attribution IS 'Whom the report is to be attributed to, and its licence; null of FARS, public domain';
COMMENT ON COLUMN judged_crashes.same_as IS 'Key of the same crash in another register, FARS first; null where it is counted here';
COMMENT ON COLUMN judged_crashes.key IS 'Key of the crash, <caseYear>-<stateCase> or <register>-<id>';
COMMENT ON COLUMN judged_crashes.case_year IS 'Year of the case file';
COMMENT ON COLUMN judged_crashes.state_case IS 'Case number, unique in its year (ST_CASE)';
COMMENT ON COLUMN judged_crashes.cohort IS 'Cohort that registered it';
COMMENT ON COLUMN judged_crashes.latitude_deg IS 'Reported latitude, WGS84, degrees';
COMMENT ON COLUMN judged_crashes.longitude_deg IS 'Reported longitude, WGS84, degrees';
COMMENT ON COLUMN judged_crashes.final_state IS 'verified, first_event_only, rejected, failed or pending';
COMMENT ON COLUMN judged_crashes.stage_reached IS 'Stage that rejected or failed it, else the last one that accepted it; null before the first';
COMMENT ON COLUMN judged_crashes.reason IS 'Reason code of a rejection';
COMMENT ON COLUMN judged_crashes.collision_type IS 'Coverage class of the manner of collision (MAN_COLL)';
COMMENT ON COLUMN judged_crashes.road_topology IS 'Coverage class of the intersection (TYP_INT)';
COMMENT ON COLUMN judged_crashes.vehicle_trajectory IS 'Coverage class of the crash type of the vehicle pair (ACC_TYPE)';
COMMENT ON COLUMN judged_crashes.kind IS 'Kind of crash, by first harmful event and vehicles (HARM_EV, VE_FORMS, SOE)';
COMMENT ON COLUMN judged_crashes.detail IS 'The sentence behind a rejection or failure, with what was measured';
COMMENT ON COLUMN judged_crashes.outdated IS 'Stage that was to run again and failed: the crash stands where it stood; null if there is none';
COMMENT ON COLUMN judged_crashes.outdated_because IS 'What happened in that attempt';
COMMENT ON COLUMN judged_crashes.state_code IS 'State (STATE), as in the case number';
COMMENT ON COLUMN judged_crashes.state_name IS 'Name of the state';
COMMENT ON COLUMN judged_crashes.place IS 'City, county and state as labelled';
COMMENT ON COLUMN judged_crashes.year IS 'Year of the crash';
COMMENT ON COLUMN judged_crashes.month IS 'Month of the crash';
COMMENT ON COLUMN judged_crashes.day IS 'Day of the crash';
COMMENT ON COLUMN judged_crashes.hour IS 'Hour of the crash, local time';
COMMENT ON COLUMN judged_crashes.minute IS 'Minute of the crash, local time';
COMMENT ON COLUMN judged_crashes.light_code IS 'Light (LGT_COND)';
COMMENT ON COLUMN judged_crashes.light IS 'Light, in words';
COMMENT ON COLUMN judged_crashes.weather_code IS 'Weather (WEATHER)';
COMMENT ON COLUMN judged_crashes.weather IS 'Weather, in words';
COMMENT ON COLUMN judged_crashes.rural_urban_code IS 'Land use (RUR_URB)';
COMMENT ON COLUMN judged_crashes.rural_urban IS 'Land use: rural or urban';
COMMENT ON COLUMN judged_crashes.function_class_code IS 'Functional class of the road (FUNC_SYS)';
COMMENT ON COLUMN judged_crashes.function_class IS 'Functional class of the road, in words';
COMMENT ON COLUMN judged_crashes.first_harmful_event_code IS 'First harmful event (HARM_EV)';
COMMENT ON COLUMN judged_crashes.first_harmful_event IS 'First harmful event, in words: what a vehicle did';
COMMENT ON COLUMN judged_crashes.road_relation_code IS 'Part of the trafficway that the first harmful event was on (REL_ROAD)';
COMMENT ON COLUMN judged_crashes.road_relation IS 'Part of the trafficway, in words';
COMMENT ON COLUMN judged_crashes.manner_of_collision_code IS 'Manner of collision of the first harmful event (MAN_COLL)';
COMMENT ON COLUMN judged_crashes.manner_of_collision IS 'Manner of collision, in words';
COMMENT ON COLUMN judged_crashes.intersection_type_code IS 'Kind of intersection (TYP_INT)';
COMMENT ON COLUMN judged_crashes.intersection_type IS 'Kind of intersection, in words';
COMMENT ON COLUMN judged_crashes.junction_relation_code IS 'Where relative to a junction (RELJCT2)';
COMMENT ON COLUMN judged_crashes.junction_relation IS 'Where relative to a junction, in words';
COMMENT ON COLUMN judged_crashes.trafficway_1 IS 'Road of the crash (TWAY_ID)';
COMMENT ON COLUMN judged_crashes.trafficway_2 IS 'Crossing road (TWAY_ID2)';
COMMENT ON COLUMN judged_crashes.vehicles IS 'Motor vehicles in the report';
COMMENT ON COLUMN judged_crashes.fatalities IS 'Persons killed (FATALS)';
COMMENT ON COLUMN judged_crashes.repaired IS 'The report was not well-formed and was repaired to be read';
COMMENT ON COLUMN judged_crashes.implied IS 'What the report does not say itself and other fields imply, such as function_class_code';
COMMENT ON COLUMN judged_crashes.contradictions IS 'Number of contradictions found in the report';
COMMENT ON COLUMN judged_crashes.ambiguities IS 'Number of things that events and persons leave open';
COMMENT ON COLUMN judged_crashes.summary IS 'The crash in words';

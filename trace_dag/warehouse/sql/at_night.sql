-- Crashes in the dark.
CREATE VIEW at_night AS
SELECT
    key,
    state_name,
    place,
    trafficway_1,
    trafficway_2,
    year,
    month,
    day,
    hour,
    light,
    weather,
    rural_urban,
    intersection_type,
    speed_limit_mph,
    vehicles,
    fatalities,
    kind,
    final_state,
    grade,
    contact_distance_m,
    delta_v_max_mph,
    summary
FROM judged_crashes
WHERE light_code IN (2, 3, 6)
ORDER BY key;

COMMENT ON VIEW at_night IS 'Crashes in the dark, with street lights or without (LGT_COND 2, 3, 6)';
COMMENT ON COLUMN at_night.key IS 'Key of the crash, <caseYear>-<stateCase> or <register>-<id>';
COMMENT ON COLUMN at_night.state_name IS 'Name of the state';
COMMENT ON COLUMN at_night.place IS 'City, county and state as labelled';
COMMENT ON COLUMN at_night.trafficway_1 IS 'Road of the crash (TWAY_ID)';
COMMENT ON COLUMN at_night.trafficway_2 IS 'Crossing road (TWAY_ID2)';
COMMENT ON COLUMN at_night.year IS 'Year of the crash';
COMMENT ON COLUMN at_night.month IS 'Month of the crash';
COMMENT ON COLUMN at_night.day IS 'Day of the crash';
COMMENT ON COLUMN at_night.hour IS 'Hour of the crash, local time';
COMMENT ON COLUMN at_night.light IS 'Light, in words';
COMMENT ON COLUMN at_night.weather IS 'Weather, in words';
COMMENT ON COLUMN at_night.rural_urban IS 'Land use: rural or urban';
COMMENT ON COLUMN at_night.intersection_type IS 'Kind of intersection, in words';
COMMENT ON COLUMN at_night.speed_limit_mph IS 'Speed limit, the highest of the vehicles, mph';
COMMENT ON COLUMN at_night.vehicles IS 'Motor vehicles in the report';
COMMENT ON COLUMN at_night.fatalities IS 'Persons killed (FATALS)';
COMMENT ON COLUMN at_night.kind IS 'Kind of crash, by first harmful event and vehicles (HARM_EV, VE_FORMS, SOE)';
COMMENT ON COLUMN at_night.final_state IS 'verified, first_event_only, rejected, failed or pending';
COMMENT ON COLUMN at_night.grade IS 'How well it is supported: corroborated or consistent; null of a rejected crash';
COMMENT ON COLUMN at_night.contact_distance_m IS 'First contact, or overturn, from the reported point, m';
COMMENT ON COLUMN at_night.delta_v_max_mph IS 'Change of velocity, the larger of the vehicles, mph';
COMMENT ON COLUMN at_night.summary IS 'The crash in words';

-- Head-on crashes, on whatever road.
CREATE VIEW head_on AS
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
WHERE collision_type = 'front_to_front'
ORDER BY key;

COMMENT ON VIEW head_on IS 'Crashes in which vehicles met front to front';
COMMENT ON COLUMN head_on.key IS 'Key of the crash, <caseYear>-<stateCase> or <register>-<id>';
COMMENT ON COLUMN head_on.state_name IS 'Name of the state';
COMMENT ON COLUMN head_on.place IS 'City, county and state as labelled';
COMMENT ON COLUMN head_on.trafficway_1 IS 'Road of the crash (TWAY_ID)';
COMMENT ON COLUMN head_on.trafficway_2 IS 'Crossing road (TWAY_ID2)';
COMMENT ON COLUMN head_on.year IS 'Year of the crash';
COMMENT ON COLUMN head_on.month IS 'Month of the crash';
COMMENT ON COLUMN head_on.day IS 'Day of the crash';
COMMENT ON COLUMN head_on.hour IS 'Hour of the crash, local time';
COMMENT ON COLUMN head_on.light IS 'Light, in words';
COMMENT ON COLUMN head_on.weather IS 'Weather, in words';
COMMENT ON COLUMN head_on.rural_urban IS 'Land use: rural or urban';
COMMENT ON COLUMN head_on.intersection_type IS 'Kind of intersection, in words';
COMMENT ON COLUMN head_on.speed_limit_mph IS 'Speed limit, the highest of the vehicles, mph';
COMMENT ON COLUMN head_on.vehicles IS 'Motor vehicles in the report';
COMMENT ON COLUMN head_on.fatalities IS 'Persons killed (FATALS)';
COMMENT ON COLUMN head_on.kind IS 'Kind of crash, by first harmful event and vehicles (HARM_EV, VE_FORMS, SOE)';
COMMENT ON COLUMN head_on.final_state IS 'verified, first_event_only, rejected, failed or pending';
COMMENT ON COLUMN head_on.grade IS 'How well it is supported: corroborated or consistent; null of a rejected crash';
COMMENT ON COLUMN head_on.contact_distance_m IS 'First contact, or overturn, from the reported point, m';
COMMENT ON COLUMN head_on.delta_v_max_mph IS 'Change of velocity, the larger of the vehicles, mph';
COMMENT ON COLUMN head_on.summary IS 'The crash in words';

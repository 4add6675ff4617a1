-- Every registered crash, in exactly one final state. What the report says is null where it could not be read; of a
-- report that no stage has read yet, place and classes are those its source gives.
CREATE TABLE crashes AS
WITH named AS (
    SELECT key, if(key[1] BETWEEN '1' AND '9', 'fars', split_part(key, '-', 1)) AS register FROM standing
),

moments AS (
    SELECT named.key, named.register, record.latitude_deg, record.longitude_deg, record.year, record.month, record.day,
        60 * record.hour + record.minute AS minutes
    FROM named
    JOIN crash_record AS record USING (key)
),

-- Two registers have one crash: on one day, no more than 10 minutes and 150 m apart.
same AS (
    SELECT later.key, min(earlier.key) AS same_as
    FROM moments AS later
    JOIN moments AS earlier
        ON (earlier.register = 'fars' OR earlier.register < later.register)
        AND earlier.register <> later.register
        AND later.register <> 'fars'
        AND earlier.year = later.year AND earlier.month = later.month AND earlier.day = later.day
        AND abs(earlier.minutes - later.minutes) <= 10
        AND 111195 * sqrt(
            (earlier.latitude_deg - later.latitude_deg) ** 2
            + ((earlier.longitude_deg - later.longitude_deg) * cos(radians(later.latitude_deg))) ** 2
        ) <= 150
    GROUP BY later.key
)

SELECT
    standing.key,
    CASE WHEN named.register = 'fars' THEN CAST(split_part(standing.key, '-', 1) AS INTEGER) ELSE record.case_year END
        AS case_year,
    CASE WHEN named.register = 'fars' THEN CAST(split_part(standing.key, '-', 2) AS INTEGER) END AS state_case,
    standing.cohort,
    coalesce(record.latitude_deg, listing.latitude_deg) AS latitude_deg,
    coalesce(record.longitude_deg, listing.longitude_deg) AS longitude_deg,
    standing.final_state,
    standing.stage_reached,
    standing.reason,
    coalesce(record.collision_type, listing.collision_type) AS collision_type,
    coalesce(record.road_topology, listing.road_topology) AS road_topology,
    coalesce(record.vehicle_trajectory, listing.vehicle_trajectory) AS vehicle_trajectory,
    coalesce(record.kind, listing.kind) AS kind,
    standing.detail,
    standing.outdated,
    standing.outdated_because,
    CASE
        WHEN named.register = 'fars' THEN CAST(split_part(standing.key, '-', 2) AS INTEGER) // 10000
        ELSE record.state_code
    END AS state_code,
    state.name AS state_name,
    nullif(
        concat_ws(', ', nullif(record.city_name, ''), nullif(record.county_name, ''), nullif(record.state_name, '')), ''
    ) AS place,
    nullif(record.city_name, '') AS city,
    nullif(record.county_name, '') AS county,
    record.year,
    record.month,
    record.day,
    try(make_date(record.year, record.month, record.day)) AS crash_date,
    dayname(try(make_date(record.year, record.month, record.day))) AS weekday,
    record.hour,
    record.minute,
    record.light_code,
    meaning_of('LGT_COND', record.light_code) AS light,
    record.weather_code,
    meaning_of('WEATHER', record.weather_code) AS weather,
    record.rural_urban_code,
    meaning_of('RUR_URB', record.rural_urban_code) AS rural_urban,
    record.function_class_code,
    meaning_of('FUNC_SYS', record.function_class_code) AS function_class,
    record.first_harmful_event_code,
    meaning_of('HARM_EV', record.first_harmful_event_code) AS first_harmful_event,
    record.road_relation_code,
    meaning_of('REL_ROAD', record.road_relation_code) AS road_relation,
    known_code('MAN_COLL', record.manner_of_collision_code) AS manner_of_collision_code,
    meaning_of('MAN_COLL', record.manner_of_collision_code) AS manner_of_collision,
    known_code('TYP_INT', record.intersection_type_code) AS intersection_type_code,
    meaning_of('TYP_INT', record.intersection_type_code) AS intersection_type,
    record.junction_relation_code,
    meaning_of('RELJCT2', record.junction_relation_code) AS junction_relation,
    nullif(record.trafficway_1, '') AS trafficway_1,
    nullif(record.trafficway_2, '') AS trafficway_2,
    coalesce(len(record.vehicles), listing.vehicles) AS vehicles,
    record.fatalities,
    named.register,
    coalesce(record.severity, CASE WHEN named.register = 'fars' THEN 'K' END) AS severity,
    nullif(record.attribution, '') AS attribution,
    same.same_as,
    record.repaired,
    record.implied,
    len(record.contradictions) AS contradictions,
    len(record.ambiguities) AS ambiguities,
    record.summary
FROM standing
JOIN named USING (key)
LEFT JOIN crash_record AS record USING (key)
LEFT JOIN listing USING (key)
LEFT JOIN same USING (key)
LEFT JOIN state ON state.code = CASE
    WHEN named.register = 'fars' THEN CAST(split_part(standing.key, '-', 2) AS INTEGER) // 10000
    ELSE record.state_code
END
ORDER BY named.register <> 'fars', named.register, case_year, state_case, standing.key;

COMMENT ON TABLE crashes IS 'Every registered crash, once, with its state';
COMMENT ON COLUMN crashes.key IS 'Key of the crash, <caseYear>-<stateCase> or <register>-<id>';
COMMENT ON COLUMN crashes.register IS 'Register that the report is of: fars, or the name of another';
COMMENT ON COLUMN crashes.case_year IS 'Year of the case file; of other registers than FARS the year of the crash';
COMMENT ON COLUMN crashes.state_case IS 'Case number, unique in its year (ST_CASE)';
COMMENT ON COLUMN crashes.cohort IS 'Cohort that registered it';
COMMENT ON COLUMN crashes.latitude_deg IS 'Reported latitude, WGS84, degrees';
COMMENT ON COLUMN crashes.longitude_deg IS 'Reported longitude, WGS84, degrees';
COMMENT ON COLUMN crashes.final_state IS 'verified, first_event_only, rejected, failed or pending';
COMMENT ON COLUMN crashes.stage_reached IS 'Stage that rejected or failed it, else the last one that accepted it; null before the first';
COMMENT ON COLUMN crashes.reason IS 'Reason code of a rejection';
COMMENT ON COLUMN crashes.collision_type IS 'Coverage class of the manner of collision (MAN_COLL)';
COMMENT ON COLUMN crashes.road_topology IS 'Coverage class of the intersection (TYP_INT)';
COMMENT ON COLUMN crashes.vehicle_trajectory IS 'Coverage class of the crash type of the vehicle pair (ACC_TYPE)';
COMMENT ON COLUMN crashes.kind IS 'Kind of crash, by first harmful event and vehicles (HARM_EV, VE_FORMS, SOE)';
COMMENT ON COLUMN crashes.detail IS 'The sentence behind a rejection or failure, with what was measured';
COMMENT ON COLUMN crashes.outdated IS 'Stage that failed when run again, so that the earlier results are kept; null if there is none';
COMMENT ON COLUMN crashes.outdated_because IS 'Message of the failed attempt';
COMMENT ON COLUMN crashes.state_code IS 'State (STATE), as in the case number';
COMMENT ON COLUMN crashes.state_name IS 'Name of the state';
COMMENT ON COLUMN crashes.place IS 'City, county and state as labelled';
COMMENT ON COLUMN crashes.city IS 'City as labelled, null outside cities and where none is reported';
COMMENT ON COLUMN crashes.county IS 'County as labelled';
COMMENT ON COLUMN crashes.year IS 'Year of the crash';
COMMENT ON COLUMN crashes.month IS 'Month of the crash';
COMMENT ON COLUMN crashes.day IS 'Day of the crash';
COMMENT ON COLUMN crashes.crash_date IS 'Date of the crash; null where the day is not reported';
COMMENT ON COLUMN crashes.weekday IS 'Day of the week, such as Saturday';
COMMENT ON COLUMN crashes.hour IS 'Hour of the crash, local time';
COMMENT ON COLUMN crashes.minute IS 'Minute of the crash, local time';
COMMENT ON COLUMN crashes.light_code IS 'Light (LGT_COND)';
COMMENT ON COLUMN crashes.light IS 'Light, in words';
COMMENT ON COLUMN crashes.weather_code IS 'Weather (WEATHER)';
COMMENT ON COLUMN crashes.weather IS 'Weather, in words';
COMMENT ON COLUMN crashes.rural_urban_code IS 'Land use (RUR_URB)';
COMMENT ON COLUMN crashes.rural_urban IS 'Land use: rural or urban';
COMMENT ON COLUMN crashes.function_class_code IS 'Functional class of the road (FUNC_SYS)';
COMMENT ON COLUMN crashes.function_class IS 'Functional class of the road, in words';
COMMENT ON COLUMN crashes.first_harmful_event_code IS 'First harmful event (HARM_EV)';
COMMENT ON COLUMN crashes.first_harmful_event IS 'First harmful event, in words: what a vehicle did';
COMMENT ON COLUMN crashes.road_relation_code IS 'Part of the trafficway that the first harmful event was on (REL_ROAD)';
COMMENT ON COLUMN crashes.road_relation IS 'Part of the trafficway, in words';
COMMENT ON COLUMN crashes.manner_of_collision_code IS 'Manner of collision of the first harmful event (MAN_COLL)';
COMMENT ON COLUMN crashes.manner_of_collision IS 'Manner of collision, in words';
COMMENT ON COLUMN crashes.intersection_type_code IS 'Kind of intersection (TYP_INT)';
COMMENT ON COLUMN crashes.intersection_type IS 'Kind of intersection, in words';
COMMENT ON COLUMN crashes.junction_relation_code IS 'Where relative to a junction (RELJCT2)';
COMMENT ON COLUMN crashes.junction_relation IS 'Where relative to a junction, in words';
COMMENT ON COLUMN crashes.trafficway_1 IS 'Road of the crash (TWAY_ID)';
COMMENT ON COLUMN crashes.trafficway_2 IS 'Crossing road (TWAY_ID2)';
COMMENT ON COLUMN crashes.vehicles IS 'Motor vehicles in the report';
COMMENT ON COLUMN crashes.fatalities IS 'Persons killed (FATALS)';
COMMENT ON COLUMN crashes.severity IS 'How badly anybody was hurt, on the KABCO scale: K killed, A, B, C, O not at all';
COMMENT ON COLUMN crashes.attribution IS 'Whom the report is to be attributed to, and its licence; null of FARS, public domain';
COMMENT ON COLUMN crashes.same_as IS 'Key of the same crash in another register, FARS first; null where it is counted here';
COMMENT ON COLUMN crashes.repaired IS 'The report was not well-formed and was repaired to be read';
COMMENT ON COLUMN crashes.implied IS 'What the report does not say itself and other fields imply, such as function_class_code';
COMMENT ON COLUMN crashes.contradictions IS 'Number of contradictions found in the report';
COMMENT ON COLUMN crashes.ambiguities IS 'Number of things that events and persons leave open';
COMMENT ON COLUMN crashes.summary IS 'The crash in words';

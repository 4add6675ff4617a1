-- Crashes as people look for them: conditions, road, parties, and all of it in words; a row per report that was read.
CREATE TABLE catalogue AS
WITH of_vehicles AS (
    SELECT
        key,
        first(surface_condition ORDER BY vehicle_number) FILTER (surface_condition IS NOT NULL) AS surface,
        max(speed_limit_mph) AS speed_limit_mph,
        max(lanes) AS lanes,
        bool_or(traffic_control_code IN (1, 2, 3, 4, 8, 9)) AS signalised,
        string_agg(DISTINCT vehicle_class, ', ' ORDER BY vehicle_class) AS bodies,
        list(critical_event_code) AS events,
        list(crash_type_code) AS types,
        list(movement_code) AS movements,
        bool_or(movement_code IN (6, 8, 9, 10, 11, 12, 13, 15, 16)) AS manoeuvres,
        bool_or(crash_type_code IN (20, 24, 28) AND movement_code IN (6, 8, 9, 10, 11, 12, 15, 16))
            AS follower_manoeuvres,
        bool_or(crash_type_code IN (21, 22, 23, 25, 26, 27, 29, 30, 31) AND movement_code IN (3, 4))
            AS lead_accelerates
    FROM vehicles
    GROUP BY key
),

of_people AS (
    SELECT key, count(*) AS people, string_agg(DISTINCT person_type, ', ' ORDER BY person_type) AS person_types
    FROM non_motorists
    GROUP BY key
),

-- Scenarios of NHTSA's typology of 37 (Najm, Smith, Yanagisawa: DOT HS 810 767, 2007), the first that applies in the
-- order of its table, by P_CRASH2, ACC_TYPE and P_CRASH1. Records have no charged violations: paths that cross straight
-- ahead at a signal count as a red light that was run, and a stop sign that was run as paths crossing without signals.
scenarios AS (
    SELECT
        key,
        coalesce(signalised, false) AS lights,
        CASE WHEN manoeuvres THEN 'with' ELSE 'without' END || ' prior vehicle manoeuvre' AS how,
        CASE WHEN lights THEN 'at signalised junctions' ELSE 'at non-signalised junctions' END AS junction,
        CASE
            WHEN list_has_any(events, [1, 2, 3, 4]) THEN 'vehicle failure'
            WHEN list_has_any(events, [5, 6, 8, 9]) THEN 'control loss ' || how
            WHEN lights AND list_has_any(types, [86, 87, 88, 89, 90, 91]) THEN 'running red light'
            WHEN list_has_any(events, [12, 13, 14]) AND list_contains(movements, 13)
                THEN 'road edge departure while backing up'
            WHEN list_has_any(events, [12, 13, 14]) THEN 'road edge departure ' || how
            WHEN list_has_any(events, [87, 88, 89]) OR kind = 'animal' THEN 'animal crash ' || how
            WHEN list_has_any(events, [80, 81, 82]) OR kind = 'pedestrian' THEN 'pedestrian crash ' || how
            WHEN list_has_any(events, [83, 84, 85]) OR kind = 'cyclist' THEN 'pedalcyclist crash ' || how
            WHEN list_has_any(types, [92, 93]) THEN 'backing up into another vehicle'
            WHEN list_has_any(types, [70, 71, 72, 73]) THEN 'turning, same direction'
            WHEN list_has_any(types, [44, 45, 46, 47, 48, 49]) THEN CASE
                WHEN list_has_any(movements, [10, 11, 12]) THEN 'turning, same direction'
                WHEN list_has_any(movements, [8, 9]) THEN 'parking, same direction'
                WHEN list_has_any(movements, [6, 15, 16]) THEN 'changing lanes, same direction'
                ELSE 'drifting, same direction'
            END
            WHEN list_has_any(types, range(50, 68)) AND manoeuvres THEN 'making a manoeuvre, opposite direction'
            WHEN list_has_any(types, range(50, 68)) THEN 'not making a manoeuvre, opposite direction'
            WHEN follower_manoeuvres THEN 'following vehicle making a manoeuvre'
            WHEN lead_accelerates THEN 'lead vehicle accelerating'
            WHEN list_has_any(types, [24, 25, 26, 27]) THEN 'lead vehicle moving at lower constant speed'
            WHEN list_has_any(types, [28, 29, 30, 31]) THEN 'lead vehicle decelerating'
            WHEN list_has_any(types, [20, 21, 22, 23]) THEN 'lead vehicle stopped'
            WHEN list_has_any(types, [68, 69]) THEN 'left turn across path from opposite directions ' || junction
            WHEN list_has_any(types, range(76, 86)) AND NOT lights THEN 'turning at non-signalised junctions'
            WHEN list_has_any(types, range(76, 86)) AND list_contains(movements, 10)
                THEN 'turning right at signalised junctions'
            WHEN list_has_any(types, range(86, 92)) THEN 'straight crossing paths at non-signalised junctions'
            WHEN list_has_any(types, [3, 8, 38, 39, 40, 41]) THEN 'evasive action ' || how
            WHEN kind = 'overturn' THEN 'non-collision incident'
            WHEN list_has_any(events, [90, 91, 92]) OR kind IN ('fixed_object', 'lying_object')
                THEN 'object crash ' || how
            ELSE 'other'
        END AS pre_crash_scenario,
        -- Names of Euro NCAP's tests of cars (protocols for crash avoidance), where the scenario is that of a test.
        CASE WHEN bodies = 'car' THEN CASE
            WHEN pre_crash_scenario = 'lead vehicle stopped' THEN 'CCRs'
            WHEN pre_crash_scenario = 'lead vehicle moving at lower constant speed' THEN 'CCRm'
            WHEN pre_crash_scenario = 'lead vehicle decelerating' THEN 'CCRb'
            WHEN starts_with(pre_crash_scenario, 'left turn across path') THEN 'CCFtap'
            WHEN list_has_any(types, range(86, 92)) THEN 'CCCscp'
            WHEN pre_crash_scenario = 'not making a manoeuvre, opposite direction' THEN 'CCFhos'
        END END AS euro_ncap
    FROM of_vehicles JOIN crashes USING (key)
),

said AS (
    SELECT key, unnest(['LGT_COND', 'WEATHER', 'FUNC_SYS', 'TYP_INT']) AS element, unnest([
        CAST(light_code AS VARCHAR), CAST(weather_code AS VARCHAR), CAST(function_class_code AS VARCHAR), road_topology
    ]) AS code
    FROM crashes
    UNION
    SELECT key, unnest(['VSURCOND', 'VTRAFCON']), unnest([
        CAST(surface_condition_code AS VARCHAR), CAST(traffic_control_code AS VARCHAR)
    ])
    FROM vehicles
),

domain AS (
    SELECT key, string_agg(DISTINCT term, '; ' ORDER BY term) AS odd
    FROM said JOIN odd_term USING (element, code)
    GROUP BY key
)

SELECT
    crashes.key,
    of_vehicles.surface,
    of_vehicles.speed_limit_mph,
    of_vehicles.lanes,
    coalesce(of_vehicles.signalised, false) AS signalised,
    of_vehicles.bodies,
    coalesce(of_people.people, 0) AS people,
    of_people.person_types,
    scenarios.pre_crash_scenario,
    scenarios.euro_ncap,
    domain.odd,
    lower(replace(concat_ws(' ', crashes.key, crashes.kind, crashes.collision_type, crashes.road_topology,
        crashes.vehicle_trajectory, crashes.light, crashes.weather, crashes.function_class, crashes.rural_urban,
        crashes.place, crashes.trafficway_1, crashes.trafficway_2, crashes.first_harmful_event,
        crashes.manner_of_collision, of_vehicles.surface, of_vehicles.bodies, of_people.person_types, domain.odd,
        scenarios.pre_crash_scenario, scenarios.euro_ncap), '_', ' ')) AS words
FROM crashes
JOIN of_vehicles USING (key)
JOIN scenarios USING (key)
LEFT JOIN of_people USING (key)
LEFT JOIN domain USING (key)
ORDER BY crashes.key;

COMMENT ON TABLE catalogue IS 'Crashes for searches by words: conditions, road, parties, and a text of all of them';
COMMENT ON COLUMN catalogue.key IS 'Key of the crash, <caseYear>-<stateCase> or <register>-<id>';
COMMENT ON COLUMN catalogue.surface IS 'Condition of the road surface, in words; of the first vehicle (VSURCOND)';
COMMENT ON COLUMN catalogue.speed_limit_mph IS 'Speed limit, the highest of the vehicles, mph (VSPD_LIM)';
COMMENT ON COLUMN catalogue.lanes IS 'Lanes of the widest roadway (VNUM_LAN)';
COMMENT ON COLUMN catalogue.signalised IS 'A vehicle had a traffic signal (VTRAFCON)';
COMMENT ON COLUMN catalogue.bodies IS 'Kinds of motor vehicles';
COMMENT ON COLUMN catalogue.people IS 'People outside motor vehicles';
COMMENT ON COLUMN catalogue.person_types IS 'Kinds of people outside motor vehicles (PER_TYP)';
COMMENT ON COLUMN catalogue.pre_crash_scenario IS 'Scenario of NHTSA''s typology of 37 (P_CRASH2, ACC_TYPE, P_CRASH1)';
COMMENT ON COLUMN catalogue.euro_ncap IS 'Name of Euro NCAP''s test of cars that it is like; null where there is none';
COMMENT ON COLUMN catalogue.odd IS 'Operational design domain in terms of ISO 34503 (clauses 9 and 10)';
COMMENT ON COLUMN catalogue.words IS 'All of it in lower case, to search in';

-- The motor vehicles of every crash whose report was read.
CREATE TABLE vehicles AS
SELECT
    record.key,
    vehicle.number AS vehicle_number,
    vehicle.vehicle_class,
    nullif(vehicle.make_model, '') AS make_model,
    vehicle.model_year,
    vehicle.length_m,
    vehicle.width_m,
    vehicle.mass_kg,
    vehicle.in_transport,
    vehicle.travel_speed_mps,
    round(vehicle.travel_speed_mps / 0.44704) AS travel_speed_mph,
    vehicle.speed_limit_mps,
    round(vehicle.speed_limit_mps / 0.44704) AS speed_limit_mph,
    vehicle.speeding,
    vehicle.driver_drinking,
    vehicle.driver_age_years,
    vehicle.driver_belted,
    vehicle.occupants_killed,
    vehicle.hit_and_run,
    vehicle.trafficway_code,
    meaning_of('VTRAFWAY', vehicle.trafficway_code) AS trafficway,
    vehicle.lanes,
    vehicle.alignment_code,
    meaning_of('VALIGN', vehicle.alignment_code) AS alignment,
    vehicle.profile_code,
    meaning_of('VPROFILE', vehicle.profile_code) AS profile,
    vehicle.traffic_control_code,
    meaning_of('VTRAFCON', vehicle.traffic_control_code) AS traffic_control,
    vehicle.disobeyed_control,
    known_code('P_CRASH1', vehicle.movement) AS movement_code,
    meaning_of('P_CRASH1', vehicle.movement) AS movement,
    vehicle.critical_event_code,
    meaning_of('P_CRASH2', vehicle.critical_event_code) AS critical_event,
    known_code('ACC_TYPE', vehicle.crash_type_code) AS crash_type_code,
    meaning_of('ACC_TYPE', vehicle.crash_type_code) AS crash_type,
    known_code('IMPACT1', vehicle.initial_impact_code) AS initial_impact_code,
    vehicle.impact.clock_h AS impact_clock_h,
    vehicle.surface_condition_code,
    meaning_of('VSURCOND', vehicle.surface_condition_code) AS surface_condition,
    vehicle.trailers,
    vehicle.trailer.length_m AS trailer_length_m,
    vehicle.trailer.mass_kg AS trailer_mass_kg,
    vehicle.jackknife_code,
    meaning_of('J_KNIFE', vehicle.jackknife_code) AS jackknife,
    vehicle.implied
FROM (SELECT key, unnest(vehicles) AS vehicle FROM crash_record) AS record
ORDER BY key, vehicle_number;

COMMENT ON TABLE vehicles IS 'The motor vehicles of every crash whose report was read';
COMMENT ON COLUMN vehicles.key IS 'Key of the crash';
COMMENT ON COLUMN vehicles.vehicle_number IS 'Number of the vehicle in the report (VEH_NO)';
COMMENT ON COLUMN vehicles.vehicle_class IS 'Kind of body it is simulated as; a guess where implied has vehicle_class';
COMMENT ON COLUMN vehicles.make_model IS 'Make and model as labelled';
COMMENT ON COLUMN vehicles.model_year IS 'Model year';
COMMENT ON COLUMN vehicles.length_m IS 'Length of the body, without a trailer, m';
COMMENT ON COLUMN vehicles.width_m IS 'Width of the body, m';
COMMENT ON COLUMN vehicles.mass_kg IS 'Mass in running order, without a trailer, kg';
COMMENT ON COLUMN vehicles.in_transport IS 'In transport, not parked or at work';
COMMENT ON COLUMN vehicles.travel_speed_mps IS 'Reported speed, m/s; null if not reported (TRAV_SP)';
COMMENT ON COLUMN vehicles.travel_speed_mph IS 'Reported speed, mph; null if not reported (TRAV_SP)';
COMMENT ON COLUMN vehicles.speed_limit_mps IS 'Speed limit, m/s (VSPD_LIM)';
COMMENT ON COLUMN vehicles.speed_limit_mph IS 'Speed limit, mph (VSPD_LIM)';
COMMENT ON COLUMN vehicles.speeding IS 'Speeding as reported (SPEEDREL)';
COMMENT ON COLUMN vehicles.driver_drinking IS 'The driver had been drinking, as reported (DR_DRINK)';
COMMENT ON COLUMN vehicles.driver_age_years IS 'Age of the driver (AGE)';
COMMENT ON COLUMN vehicles.driver_belted IS 'The driver wore a belt, as reported (REST_USE)';
COMMENT ON COLUMN vehicles.occupants_killed IS 'Occupants that were killed (DEATHS)';
COMMENT ON COLUMN vehicles.hit_and_run IS 'The driver left the scene (HIT_RUN)';
COMMENT ON COLUMN vehicles.trafficway_code IS 'Trafficway: divided or not, one-way or not (VTRAFWAY)';
COMMENT ON COLUMN vehicles.trafficway IS 'Trafficway, in words';
COMMENT ON COLUMN vehicles.lanes IS 'Lanes of the roadway, both ways where it is undivided (VNUM_LAN)';
COMMENT ON COLUMN vehicles.alignment_code IS 'Alignment: straight or curving (VALIGN)';
COMMENT ON COLUMN vehicles.alignment IS 'Alignment, in words';
COMMENT ON COLUMN vehicles.profile_code IS 'Grade (VPROFILE)';
COMMENT ON COLUMN vehicles.profile IS 'Grade, in words';
COMMENT ON COLUMN vehicles.traffic_control_code IS 'Traffic control (VTRAFCON)';
COMMENT ON COLUMN vehicles.traffic_control IS 'Traffic control, in words';
COMMENT ON COLUMN vehicles.disobeyed_control IS 'The driver disobeyed it, as charged or noted (VIOLATION, DRIVERRF)';
COMMENT ON COLUMN vehicles.movement_code IS 'Movement before the critical event (P_CRASH1); where implied has movement, as the crash type implies it';
COMMENT ON COLUMN vehicles.movement IS 'Movement before the critical event, in words';
COMMENT ON COLUMN vehicles.critical_event_code IS 'What made the crash imminent (P_CRASH2)';
COMMENT ON COLUMN vehicles.critical_event IS 'What made the crash imminent, in words';
COMMENT ON COLUMN vehicles.crash_type_code IS 'Crash type (ACC_TYPE)';
COMMENT ON COLUMN vehicles.crash_type IS 'Crash type, in words';
COMMENT ON COLUMN vehicles.initial_impact_code IS 'Area of the first impact as reported (IMPACT1)';
COMMENT ON COLUMN vehicles.impact_clock_h IS 'Clock position of the collision on the body, hours; 12 front, 3 right';
COMMENT ON COLUMN vehicles.surface_condition_code IS 'Condition of the road surface (VSURCOND)';
COMMENT ON COLUMN vehicles.surface_condition IS 'Condition of the road surface, in words';
COMMENT ON COLUMN vehicles.trailers IS 'Trailing units (TOW_VEH)';
COMMENT ON COLUMN vehicles.trailer_length_m IS 'Length of what it pulls, without a drawbar, m';
COMMENT ON COLUMN vehicles.trailer_mass_kg IS 'Mass of what it pulls, kg';
COMMENT ON COLUMN vehicles.jackknife_code IS 'Jackknifed (J_KNIFE)';
COMMENT ON COLUMN vehicles.jackknife IS 'Jackknifed, in words';
COMMENT ON COLUMN vehicles.implied IS 'What the report does not say of it and other fields imply: movement, vehicle_class, impact, ...';

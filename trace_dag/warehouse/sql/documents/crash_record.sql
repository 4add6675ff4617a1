-- Every crash record, the columns the tables need. Thousands of small files: they are read once.
SELECT
    key,
    latitude_deg,
    longitude_deg,
    collision_type,
    road_topology,
    vehicle_trajectory,
    city_name,
    county_name,
    state_name,
    year,
    month,
    day,
    hour,
    trafficway_1,
    trafficway_2,
    fatalities,
    repaired,
    contradictions,
    summary,
    vehicles,
    events
FROM read_parquet(getvariable('record_files'))

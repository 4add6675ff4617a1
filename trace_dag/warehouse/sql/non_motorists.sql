-- The persons outside motor vehicles of every crash whose report was read.
CREATE TABLE non_motorists AS
SELECT
    record.key,
    person.number AS person_number,
    person.party,
    person.kind,
    person.person_type_code,
    person.striking_vehicle,
    person.age_years,
    person.sex_code,
    person.location_code,
    person.crosswalk_code,
    person.sidewalk_code,
    person.school_zone_code,
    person.intersection_code,
    person.pedestrian_position_code,
    person.cyclist_position_code,
    person.pedestrian_direction_code,
    person.cyclist_direction_code,
    person.motorist_direction_code,
    person.motorist_manoeuvre_code,
    person.intersection_leg_code,
    nullif(person.scenario, '') AS scenario,
    person.pedestrian_group_code,
    person.cyclist_group_code,
    person.pedestrian_type_code,
    person.cyclist_type_code,
    person.actions,
    person.circumstances,
    person.equipment,
    person.helmet_code,
    person.pads_code,
    person.other_protection_code,
    person.reflective_clothing_code,
    person.lights_code,
    person.other_prevention_code
FROM (SELECT key, unnest(non_motorists) AS person FROM crash_record) AS record
ORDER BY key, person_number;

COMMENT ON TABLE non_motorists IS 'The persons outside motor vehicles of every crash whose report was read';
COMMENT ON COLUMN non_motorists.key IS 'Key of the crash';
COMMENT ON COLUMN non_motorists.person_number IS 'Number of the person (PER_NO)';
COMMENT ON COLUMN non_motorists.party IS 'Number as a party of events, 1000 + number of the person';
COMMENT ON COLUMN non_motorists.kind IS 'pedestrian, cyclist, conveyance or other_person';
COMMENT ON COLUMN non_motorists.person_type_code IS 'Kind of person (PER_TYP, PBPTYPE)';
COMMENT ON COLUMN non_motorists.striking_vehicle IS 'Number of the vehicle that struck the person (STR_VEH)';
COMMENT ON COLUMN non_motorists.age_years IS 'Age (AGE, PBAGE)';
COMMENT ON COLUMN non_motorists.sex_code IS 'Sex (SEX, PBSEX)';
COMMENT ON COLUMN non_motorists.location_code IS 'Where the person was (LOCATION)';
COMMENT ON COLUMN non_motorists.crosswalk_code IS 'Marked crosswalk present (PBCWALK)';
COMMENT ON COLUMN non_motorists.sidewalk_code IS 'Sidewalk present (PBSWALK)';
COMMENT ON COLUMN non_motorists.school_zone_code IS 'In a school zone (PBSZONE)';
COMMENT ON COLUMN non_motorists.intersection_code IS 'At an intersection (PEDLOC, BIKELOC)';
COMMENT ON COLUMN non_motorists.pedestrian_position_code IS 'Position of a pedestrian when struck (PEDPOS)';
COMMENT ON COLUMN non_motorists.cyclist_position_code IS 'Position of a cyclist when struck (BIKEPOS)';
COMMENT ON COLUMN non_motorists.pedestrian_direction_code IS 'Direction of a pedestrian at an intersection (PEDDIR)';
COMMENT ON COLUMN non_motorists.cyclist_direction_code IS 'Direction of a cyclist, with or against traffic (BIKEDIR)';
COMMENT ON COLUMN non_motorists.motorist_direction_code IS 'Direction of the motorist at an intersection (MOTDIR)';
COMMENT ON COLUMN non_motorists.motorist_manoeuvre_code IS 'Manoeuvre of the motorist at an intersection (MOTMAN)';
COMMENT ON COLUMN non_motorists.intersection_leg_code IS 'Near or far side of the intersection (PEDLEG)';
COMMENT ON COLUMN non_motorists.scenario IS 'Scenario at an intersection: manoeuvre, side, crosswalk, direction (PEDSNR)';
COMMENT ON COLUMN non_motorists.pedestrian_group_code IS 'Group of pedestrian crashes (PEDCGP)';
COMMENT ON COLUMN non_motorists.cyclist_group_code IS 'Group of cyclist crashes (BIKECGP)';
COMMENT ON COLUMN non_motorists.pedestrian_type_code IS 'Type of pedestrian crash (PEDCTYPE)';
COMMENT ON COLUMN non_motorists.cyclist_type_code IS 'Type of cyclist crash (BIKECTYPE)';
COMMENT ON COLUMN non_motorists.actions IS 'What the person did before the crash (NMACTION, MPR_ACT)';
COMMENT ON COLUMN non_motorists.circumstances IS 'What the person contributed (NMCC, MTM_CRSH)';
COMMENT ON COLUMN non_motorists.equipment IS 'Safety equipment, until 2018 (MSAFEQMT)';
COMMENT ON COLUMN non_motorists.helmet_code IS 'Helmet used (NMHELMET)';
COMMENT ON COLUMN non_motorists.pads_code IS 'Protective pads used (NMPROPAD)';
COMMENT ON COLUMN non_motorists.other_protection_code IS 'Other protective equipment used (NMOTHPRO)';
COMMENT ON COLUMN non_motorists.reflective_clothing_code IS 'Reflective clothing used (NMREFCLO)';
COMMENT ON COLUMN non_motorists.lights_code IS 'Lights used (NMLIGHT)';
COMMENT ON COLUMN non_motorists.other_prevention_code IS 'Other preventive equipment used (NMOTHPRE)';

-- The persons outside motor vehicles of every crash whose report was read.
CREATE TABLE non_motorists AS
SELECT
    record.key,
    person.number AS person_number,
    person.party,
    person.kind,
    person.person_type_code,
    meaning_of('PER_TYP', person.person_type_code) AS person_type,
    person.striking_vehicle,
    person.age_years,
    person.sex_code,
    meaning_of('SEX', person.sex_code) AS sex,
    person.location_code,
    meaning_of('LOCATION', person.location_code) AS location,
    person.crosswalk_code,
    meaning_of('PBCWALK', person.crosswalk_code) AS crosswalk,
    person.sidewalk_code,
    meaning_of('PBSWALK', person.sidewalk_code) AS sidewalk,
    person.school_zone_code,
    meaning_of('PBSZONE', person.school_zone_code) AS school_zone,
    person.intersection_code,
    meaning_of('PEDLOC', person.intersection_code) AS intersection,
    person.pedestrian_position_code,
    meaning_of('PEDPOS', person.pedestrian_position_code) AS pedestrian_position,
    person.cyclist_position_code,
    meaning_of('BIKEPOS', person.cyclist_position_code) AS cyclist_position,
    person.pedestrian_direction_code,
    meaning_of('PEDDIR', person.pedestrian_direction_code) AS pedestrian_direction,
    person.cyclist_direction_code,
    meaning_of('BIKEDIR', person.cyclist_direction_code) AS cyclist_direction,
    person.motorist_direction_code,
    meaning_of('MOTDIR', person.motorist_direction_code) AS motorist_direction,
    person.motorist_manoeuvre_code,
    meaning_of('MOTMAN', person.motorist_manoeuvre_code) AS motorist_manoeuvre,
    person.intersection_leg_code,
    meaning_of('PEDLEG', person.intersection_leg_code) AS intersection_leg,
    nullif(person.scenario, '') AS scenario,
    person.pedestrian_group_code,
    meaning_of('PEDCGP', person.pedestrian_group_code) AS pedestrian_group,
    person.cyclist_group_code,
    meaning_of('BIKECGP', person.cyclist_group_code) AS cyclist_group,
    person.pedestrian_type_code,
    person.cyclist_type_code,
    person.actions AS action_codes,
    (SELECT list(meaning ORDER BY code) FROM codes WHERE element = 'NMACTION' AND list_contains(person.actions, code)) AS actions,
    person.circumstances AS circumstance_codes,
    (SELECT list(meaning ORDER BY code) FROM codes WHERE element = 'NMCC' AND list_contains(person.circumstances, code)) AS circumstances,
    person.equipment AS equipment_codes,
    (SELECT list(meaning ORDER BY code) FROM codes WHERE element = 'MSAFEQMT' AND list_contains(person.equipment, code)) AS equipment,
    person.helmet_code,
    meaning_of('NMHELMET', person.helmet_code) AS helmet,
    person.pads_code,
    meaning_of('NMPROPAD', person.pads_code) AS pads,
    person.other_protection_code,
    meaning_of('NMOTHPRO', person.other_protection_code) AS other_protection,
    person.reflective_clothing_code,
    meaning_of('NMREFCLO', person.reflective_clothing_code) AS reflective_clothing,
    person.lights_code,
    meaning_of('NMLIGHT', person.lights_code) AS lights,
    person.other_prevention_code,
    meaning_of('NMOTHPRE', person.other_prevention_code) AS other_prevention
FROM (SELECT key, unnest(non_motorists) AS person FROM crash_record) AS record
ORDER BY key, person_number;

COMMENT ON TABLE non_motorists IS 'The persons outside motor vehicles of every crash whose report was read';
COMMENT ON COLUMN non_motorists.key IS 'Key of the crash';
COMMENT ON COLUMN non_motorists.person_number IS 'Number of the person (PER_NO)';
COMMENT ON COLUMN non_motorists.party IS 'Number as a party of events, 1000 + number of the person';
COMMENT ON COLUMN non_motorists.kind IS 'pedestrian, cyclist, conveyance or other_person';
COMMENT ON COLUMN non_motorists.person_type_code IS 'Kind of person (PER_TYP, PBPTYPE)';
COMMENT ON COLUMN non_motorists.person_type IS 'Kind of person, in words';
COMMENT ON COLUMN non_motorists.striking_vehicle IS 'Number of the vehicle that struck the person (STR_VEH)';
COMMENT ON COLUMN non_motorists.age_years IS 'Age (AGE, PBAGE)';
COMMENT ON COLUMN non_motorists.sex_code IS 'Sex (SEX, PBSEX)';
COMMENT ON COLUMN non_motorists.sex IS 'Sex, in words';
COMMENT ON COLUMN non_motorists.location_code IS 'Where the person was (LOCATION)';
COMMENT ON COLUMN non_motorists.location IS 'Where the person was, in words';
COMMENT ON COLUMN non_motorists.crosswalk_code IS 'Marked crosswalk present (PBCWALK)';
COMMENT ON COLUMN non_motorists.crosswalk IS 'Marked crosswalk present, in words';
COMMENT ON COLUMN non_motorists.sidewalk_code IS 'Sidewalk present (PBSWALK)';
COMMENT ON COLUMN non_motorists.sidewalk IS 'Sidewalk present, in words';
COMMENT ON COLUMN non_motorists.school_zone_code IS 'In a school zone (PBSZONE)';
COMMENT ON COLUMN non_motorists.school_zone IS 'In a school zone, in words';
COMMENT ON COLUMN non_motorists.intersection_code IS 'At an intersection (PEDLOC, BIKELOC)';
COMMENT ON COLUMN non_motorists.intersection IS 'At an intersection, in words';
COMMENT ON COLUMN non_motorists.pedestrian_position_code IS 'Position of a pedestrian when struck (PEDPOS)';
COMMENT ON COLUMN non_motorists.pedestrian_position IS 'Position of a pedestrian when struck, in words';
COMMENT ON COLUMN non_motorists.cyclist_position_code IS 'Position of a cyclist when struck (BIKEPOS)';
COMMENT ON COLUMN non_motorists.cyclist_position IS 'Position of a cyclist when struck, in words';
COMMENT ON COLUMN non_motorists.pedestrian_direction_code IS 'Direction of a pedestrian at an intersection (PEDDIR)';
COMMENT ON COLUMN non_motorists.pedestrian_direction IS 'Direction of a pedestrian at an intersection, in words';
COMMENT ON COLUMN non_motorists.cyclist_direction_code IS 'Direction of a cyclist, with or against traffic (BIKEDIR)';
COMMENT ON COLUMN non_motorists.cyclist_direction IS 'Direction of a cyclist, with or against traffic, in words';
COMMENT ON COLUMN non_motorists.motorist_direction_code IS 'Direction of the motorist at an intersection (MOTDIR)';
COMMENT ON COLUMN non_motorists.motorist_direction IS 'Direction of the motorist at an intersection, in words';
COMMENT ON COLUMN non_motorists.motorist_manoeuvre_code IS 'Manoeuvre of the motorist at an intersection (MOTMAN)';
COMMENT ON COLUMN non_motorists.motorist_manoeuvre IS 'Manoeuvre of the motorist at an intersection, in words';
COMMENT ON COLUMN non_motorists.intersection_leg_code IS 'Near or far side of the intersection (PEDLEG)';
COMMENT ON COLUMN non_motorists.intersection_leg IS 'Near or far side of the intersection, in words';
COMMENT ON COLUMN non_motorists.scenario IS 'Scenario at an intersection: manoeuvre, side, crosswalk, direction (PEDSNR)';
COMMENT ON COLUMN non_motorists.pedestrian_group_code IS 'Group of pedestrian crashes (PEDCGP)';
COMMENT ON COLUMN non_motorists.pedestrian_group IS 'Group of pedestrian crashes, in words';
COMMENT ON COLUMN non_motorists.cyclist_group_code IS 'Group of cyclist crashes (BIKECGP)';
COMMENT ON COLUMN non_motorists.cyclist_group IS 'Group of cyclist crashes, in words';
COMMENT ON COLUMN non_motorists.pedestrian_type_code IS 'Type of pedestrian crash (PEDCTYPE)';
COMMENT ON COLUMN non_motorists.cyclist_type_code IS 'Type of cyclist crash (BIKECTYPE)';
COMMENT ON COLUMN non_motorists.action_codes IS 'What the person did before the crash (NMACTION, MPR_ACT)';
COMMENT ON COLUMN non_motorists.actions IS 'What the person did before the crash, in words';
COMMENT ON COLUMN non_motorists.circumstance_codes IS 'What the person contributed (NMCC, MTM_CRSH)';
COMMENT ON COLUMN non_motorists.circumstances IS 'What the person contributed, in words';
COMMENT ON COLUMN non_motorists.equipment_codes IS 'Safety equipment, until 2018 (MSAFEQMT)';
COMMENT ON COLUMN non_motorists.equipment IS 'Safety equipment, until 2018, in words';
COMMENT ON COLUMN non_motorists.helmet_code IS 'Helmet used (NMHELMET)';
COMMENT ON COLUMN non_motorists.helmet IS 'Helmet used, in words';
COMMENT ON COLUMN non_motorists.pads_code IS 'Protective pads used (NMPROPAD)';
COMMENT ON COLUMN non_motorists.pads IS 'Protective pads used, in words';
COMMENT ON COLUMN non_motorists.other_protection_code IS 'Other protective equipment used (NMOTHPRO)';
COMMENT ON COLUMN non_motorists.other_protection IS 'Other protective equipment used, in words';
COMMENT ON COLUMN non_motorists.reflective_clothing_code IS 'Reflective clothing used (NMREFCLO)';
COMMENT ON COLUMN non_motorists.reflective_clothing IS 'Reflective clothing used, in words';
COMMENT ON COLUMN non_motorists.lights_code IS 'Lights used (NMLIGHT)';
COMMENT ON COLUMN non_motorists.lights IS 'Lights used, in words';
COMMENT ON COLUMN non_motorists.other_prevention_code IS 'Other preventive equipment used (NMOTHPRE)';
COMMENT ON COLUMN non_motorists.other_prevention IS 'Other preventive equipment used, in words';

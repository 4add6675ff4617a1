-- The sequence of events of every crash whose report was read.
CREATE TABLE events AS
SELECT
    record.key,
    event.number AS event_number,
    event.code AS event_code,
    meaning_of('SOE', event.code) AS event,
    event.kind,
    event.party_1,
    event.area_1.clock_h AS clock_1_h,
    event.party_2,
    event.area_2.clock_h AS clock_2_h,
    event.implied,
    became.outcome,
    nullif(became.why, '') AS why
FROM (SELECT key, unnest(events) AS event FROM crash_record) AS record
LEFT JOIN (SELECT key, unnest(events) AS became FROM verdict) AS judged
    ON judged.key = record.key AND became.event_number = event.number
ORDER BY record.key, event_number;

COMMENT ON TABLE events IS 'The sequence of events of every crash whose report was read';
COMMENT ON COLUMN events.key IS 'Key of the crash';
COMMENT ON COLUMN events.event_number IS 'Number in the sequence (EVENTNUM)';
COMMENT ON COLUMN events.event_code IS 'What happened (SOE)';
COMMENT ON COLUMN events.event IS 'What happened, in words: what the first party did';
COMMENT ON COLUMN events.kind IS 'Kind of event, from its code';
COMMENT ON COLUMN events.party_1 IS 'First party (VNUMBER1)';
COMMENT ON COLUMN events.clock_1_h IS 'Clock position struck on the first party, hours (AOI1)';
COMMENT ON COLUMN events.party_2 IS 'Second party: a vehicle (VNUMBER2), 1000 + number of a person, 2000 + number of the event that struck a thing';
COMMENT ON COLUMN events.clock_2_h IS 'Clock position struck on the second party, hours (AOI2)';
COMMENT ON COLUMN events.implied IS 'Fields of the event derived from others';
COMMENT ON COLUMN events.outcome IS 'What becomes of a harmful event in the simulation: happened, missed or not_modelled; null without a verdict';
COMMENT ON COLUMN events.why IS 'Why it does not happen';

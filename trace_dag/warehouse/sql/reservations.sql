-- Every doubt about an accepted crash: with any but no_areas it is not verified.
CREATE TABLE reservations AS
SELECT key, support.detail = '' AS otherwise_corroborated, doubtful.doubt AS doubt, doubtful.detail AS detail
FROM (SELECT key, support, unnest(reservations) AS doubtful FROM verdict)
ORDER BY ALL;

COMMENT ON TABLE reservations IS 'Every doubt about an accepted crash; with any but no_areas it is not verified, and those about street, course and areas bar corroboration too';
COMMENT ON COLUMN reservations.key IS 'Key of the crash';
COMMENT ON COLUMN reservations.otherwise_corroborated IS 'Whether facts and support would suffice without the doubts; null if no support is measured';
COMMENT ON COLUMN reservations.doubt IS 'event_missed, harmless, other_street, centreline_not_crossed, median_not_crossed, departure_missed, return_missed, not_airborne, other_zone, unreported_overturn, unreported_departure, other_vehicle_missing, no_street, far_off_road, other_carriageway, spun, starts_in_lane, other_junction, other_face, objects_overlap, object_at_rest or no_areas';
COMMENT ON COLUMN reservations.detail IS 'What was found, in words';

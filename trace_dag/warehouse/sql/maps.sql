-- Every road map: what it holds and where the crash lies on it.
CREATE TABLE maps AS
SELECT
    key,
    converter,
    roads,
    junctions,
    placement.road_id AS crash_road,
    placement.junction_id AS crash_junction,
    placement.moved_m,
    placement.matched_by,
    placement.x_m AS crash_x_m,
    placement.y_m AS crash_y_m,
    list_min([each.distance_m for each in structures if each.kind = 'bridge']) AS bridge_distance_m,
    list_min([each.distance_m for each in structures if each.kind = 'tunnel']) AS tunnel_distance_m,
    len(list_filter(comparisons, lambda each: each.agreement = 'agrees')) AS attributes_that_agree,
    len(list_filter(comparisons, lambda each: each.agreement = 'differs')) AS attributes_that_differ
FROM map_report
ORDER BY key;

COMMENT ON TABLE maps IS 'Every road map: its contents and the place of the crash on it';
COMMENT ON COLUMN maps.key IS 'Key of the crash';
COMMENT ON COLUMN maps.converter IS 'Name and version of what made the map';
COMMENT ON COLUMN maps.roads IS 'Roads, connecting roads among them';
COMMENT ON COLUMN maps.junctions IS 'Junctions';
COMMENT ON COLUMN maps.crash_road IS 'Road the crash was placed on';
COMMENT ON COLUMN maps.crash_junction IS 'Junction of an intersection crash';
COMMENT ON COLUMN maps.moved_m IS 'Distance by which the reported point was moved to its carriageway, m';
COMMENT ON COLUMN maps.matched_by IS 'Evidence the road was chosen by';
COMMENT ON COLUMN maps.crash_x_m IS 'Place of the crash, east of the reported point, m';
COMMENT ON COLUMN maps.crash_y_m IS 'Place of the crash, north of the reported point, m';
COMMENT ON COLUMN maps.bridge_distance_m IS 'Nearest lane on a bridge from the crash, m; 0 on or under it, null if none within 100 m';
COMMENT ON COLUMN maps.tunnel_distance_m IS 'Nearest lane in a tunnel from the crash, m; 0 in or above it, null if none within 100 m';
COMMENT ON COLUMN maps.attributes_that_agree IS 'Attributes in which map and report agree';
COMMENT ON COLUMN maps.attributes_that_differ IS 'Attributes in which they differ';

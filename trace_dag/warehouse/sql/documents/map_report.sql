-- What lies beside every road map, the parts the tables need.
SELECT
    key,
    unnest(from_json(content, '{
        "converter": "VARCHAR",
        "roads": "INTEGER",
        "junctions": "INTEGER",
        "placement": {
            "road_id": "VARCHAR", "junction_id": "VARCHAR", "moved_m": "DOUBLE", "matched_by": "VARCHAR",
            "x_m": "DOUBLE", "y_m": "DOUBLE"
        },
        "structures": [{"kind": "VARCHAR", "distance_m": "DOUBLE"}],
        "comparisons": [{"attribute": "VARCHAR", "reported": "VARCHAR", "mapped": "VARCHAR", "agreement": "VARCHAR"}],
        "gates": [{
            "name": "VARCHAR", "value": "DOUBLE", "threshold": "DOUBLE", "unit": "VARCHAR", "passed": "BOOLEAN",
            "detail": "VARCHAR"
        }]
    }'))
FROM document

-- Every verdict with its criteria.
SELECT
    key,
    unnest(from_json(content, '{
        "label": "VARCHAR", "grade": "VARCHAR", "hypothesis": "INTEGER", "rule_set": "VARCHAR",
        "criteria": [{
            "name": "VARCHAR", "value": "DOUBLE", "threshold": "DOUBLE", "unit": "VARCHAR", "passed": "BOOLEAN",
            "reason": "VARCHAR", "detail": "VARCHAR", "vehicle_number": "INTEGER", "event_number": "INTEGER"
        }],
        "alternatives": "VARCHAR",
        "direction_open": [{"party": "INTEGER", "side": "VARCHAR", "share": "DOUBLE"}],
        "events": [{"event_number": "INTEGER", "code": "INTEGER", "outcome": "VARCHAR", "why": "VARCHAR"}],
        "reservations": [{"doubt": "VARCHAR", "detail": "VARCHAR"}],
        "sight_lines": [{
            "driver": "INTEGER", "other": "INTEGER", "seen_for_s": "DOUBLE", "hidden_share": "DOUBLE",
            "hidden_by": "VARCHAR", "osm_id": "VARCHAR"
        }],
        "support": {
            "total": "DOUBLE", "independent_facts": "INTEGER", "detail": "VARCHAR",
            "facts": [{
                "name": "VARCHAR", "against": "VARCHAR", "agreement": "VARCHAR", "reported": "VARCHAR",
                "found": "VARCHAR", "essential": "BOOLEAN", "vehicle_number": "INTEGER", "weight": "DOUBLE"
            }]
        }
    }'))
FROM document

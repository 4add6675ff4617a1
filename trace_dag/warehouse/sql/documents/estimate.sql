-- Every state estimate without its trajectories.
SELECT
    key,
    unnest(from_json(content, '{
        "ambiguity": "DOUBLE",
        "run": {
            "estimator": "VARCHAR", "version": "VARCHAR", "model": "VARCHAR", "prompt_version": "VARCHAR",
            "attempts": "INTEGER", "prompt_tokens": "BIGINT", "completion_tokens": "BIGINT", "cost_usd": "DOUBLE",
            "latency_s": "DOUBLE", "fallback_from": "VARCHAR", "fallback_reason": "VARCHAR"
        },
        "hypotheses": [{
            "name": "VARCHAR", "score": "DOUBLE", "impact_time_s": "DOUBLE",
            "participants": [{
                "vehicle_number": "INTEGER", "manoeuvre": "VARCHAR",
                "initial_pose": {"x_m": "DOUBLE", "y_m": "DOUBLE", "heading_rad": "DOUBLE"},
                "initial_speed_mps": "DOUBLE", "speed_source": "VARCHAR",
                "impact_pose": {"x_m": "DOUBLE", "y_m": "DOUBLE", "heading_rad": "DOUBLE"},
                "impact_speed_mps": "DOUBLE", "impact_clock_h": "DOUBLE"
            }]
        }]
    }'))
FROM document

-- The vehicles of every estimate's hypotheses: initial and impact states in the crash's local frame.
CREATE TABLE estimated_states AS
SELECT
    key,
    hypothesis,
    state.vehicle_number AS vehicle_number,
    state.manoeuvre,
    state.initial_pose.x_m AS initial_x_m,
    state.initial_pose.y_m AS initial_y_m,
    state.initial_pose.heading_rad AS initial_heading_rad,
    state.initial_speed_mps,
    state.speed_source,
    state.impact_pose.x_m AS impact_x_m,
    state.impact_pose.y_m AS impact_y_m,
    state.impact_pose.heading_rad AS impact_heading_rad,
    state.impact_speed_mps,
    state.impact_clock_h
FROM (
    SELECT key, hypothesis, unnest(content.participants) AS state
    FROM (
        SELECT key, generate_subscripts(hypotheses, 1) - 1 AS hypothesis, unnest(hypotheses) AS content
        FROM estimate
    )
)
ORDER BY key, hypothesis, vehicle_number;

COMMENT ON TABLE estimated_states IS 'The vehicles of every hypothesis: initial and impact states, local frame of the crash';
COMMENT ON COLUMN estimated_states.key IS 'Key of the crash';
COMMENT ON COLUMN estimated_states.hypothesis IS 'Index of the hypothesis, 0 the best';
COMMENT ON COLUMN estimated_states.vehicle_number IS 'Number of the vehicle in the report';
COMMENT ON COLUMN estimated_states.manoeuvre IS 'How it got from its initial lane to the crash';
COMMENT ON COLUMN estimated_states.initial_x_m IS 'Initial position of its centre, east of the reported point, m';
COMMENT ON COLUMN estimated_states.initial_y_m IS 'Initial position of its centre, north of the reported point, m';
COMMENT ON COLUMN estimated_states.initial_heading_rad IS 'Initial heading, radians counter-clockwise from east';
COMMENT ON COLUMN estimated_states.initial_speed_mps IS 'Initial speed, m/s';
COMMENT ON COLUMN estimated_states.speed_source IS 'Where the initial speed comes from; a reported one is kept';
COMMENT ON COLUMN estimated_states.impact_x_m IS 'Position of its centre at the impact, east of the reported point, m';
COMMENT ON COLUMN estimated_states.impact_y_m IS 'Position of its centre at the impact, north of the reported point, m';
COMMENT ON COLUMN estimated_states.impact_heading_rad IS 'Heading at the impact, radians counter-clockwise from east';
COMMENT ON COLUMN estimated_states.impact_speed_mps IS 'Speed at the impact, m/s';
COMMENT ON COLUMN estimated_states.impact_clock_h IS 'Planned contact on its body, hours of the clock';

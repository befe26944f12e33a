CREATE TABLE strategy (
    id VARCHAR(128) NOT NULL PRIMARY KEY,
    origin VARCHAR(16) NOT NULL,
    class VARCHAR(32) NOT NULL,
    mode VARCHAR(32) NOT NULL,
    tool VARCHAR(32) NOT NULL,
    focus VARCHAR(16) NOT NULL,
    form VARCHAR(16) NOT NULL,
    diameter_min_m DOUBLE NOT NULL,
    diameter_max_m DOUBLE NOT NULL,
    length_min_m DOUBLE NOT NULL,
    length_max_m DOUBLE NOT NULL,
    distance_min_m DOUBLE NOT NULL,
    distance_max_m DOUBLE NOT NULL,
    mass_min_kg DOUBLE NOT NULL,
    mass_max_kg DOUBLE NOT NULL,
    flexible BIGINT NOT NULL
)

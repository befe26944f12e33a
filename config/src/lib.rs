//! The files of a cell, read and checked: TOML, URDF and JSON become values nobody else can build.

//! Geographical positions as metres on a plane, and distances there.

/// Semi-major axis in m of the ellipsoid of WGS 84.
const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// Flattening of the ellipsoid of WGS 84.
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// The plane that touches the ellipsoid, raised to a height, at one point: east and north in m.
///
/// Paths of up to 50 km keep their length within 3e-5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalPlane {
    latitude_deg: f64,
    longitude_deg: f64,
    height_m: f64,
}

impl LocalPlane {
    /// Returns a plane around a point.
    pub fn around(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Self {
        LocalPlane { latitude_deg, longitude_deg, height_m }
    }

    /// East and north in m of a position in degrees.
    pub fn project(&self, latitude_deg: f64, longitude_deg: f64) -> [f64; 2] {
        let [x0, y0, z0] = self.centred(self.latitude_deg, self.longitude_deg);
        let [x, y, z] = self.centred(latitude_deg, longitude_deg);
        let [dx, dy, dz] = [x - x0, y - y0, z - z0];
        let (sin_lat, cos_lat) = self.latitude_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = self.longitude_deg.to_radians().sin_cos();
        [cos_lon * dy - sin_lon * dx, cos_lat * dz - sin_lat * (cos_lon * dx + sin_lon * dy)]
    }

    /// Latitude and longitude in degrees of a point in m east and north.
    pub fn unproject(&self, point_m: [f64; 2]) -> [f64; 2] {
        let mut at = [self.latitude_deg, self.longitude_deg];
        // The radius of curvature is right to a percent, so that each round gains two digits.
        for _ in 0..8 {
            let [east_m, north_m] = self.project(at[0], at[1]);
            let degree_m = (SEMI_MAJOR_M + self.height_m) * 1f64.to_radians();
            at[0] += (point_m[1] - north_m) / degree_m;
            at[1] += (point_m[0] - east_m) / (degree_m * at[0].to_radians().cos());
        }
        at
    }

    /// Coordinates in m from the centre of the earth.
    fn centred(&self, latitude_deg: f64, longitude_deg: f64) -> [f64; 3] {
        let (sin_lat, cos_lat) = latitude_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = longitude_deg.to_radians().sin_cos();
        let squeeze = FLATTENING * (2.0 - FLATTENING);
        let normal_m = SEMI_MAJOR_M / (1.0 - squeeze * sin_lat * sin_lat).sqrt();
        let across_m = (normal_m + self.height_m) * cos_lat;
        let up_m = (normal_m * (1.0 - squeeze) + self.height_m) * sin_lat;
        [across_m * cos_lon, across_m * sin_lon, up_m]
    }
}

/// Squared distance in m² of two points of a plane.
pub fn distance_squared(one: [f64; 2], other: [f64; 2]) -> f64 {
    let [x, y] = [one[0] - other[0], one[1] - other[1]];
    x * x + y * y
}

/// The point that lies so much of the way between two points.
pub fn between(from: [f64; 2], to: [f64; 2], share: f64) -> [f64; 2] {
    [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_minute_of_latitude_is_a_nautical_mile() {
        let plane = LocalPlane::around(45.0, 8.0, 0.0);
        let [east_m, north_m] = plane.project(45.0 + 1.0 / 60.0, 8.0);
        // 1852.2 m at 45° by the meridian's radius of curvature.
        assert!((north_m - 1852.2).abs() < 0.5 && east_m.abs() < 1e-6, "{east_m} {north_m}");
    }

    #[test]
    fn a_point_comes_back_from_the_plane() {
        let plane = LocalPlane::around(47.4, 8.5, 430.0);
        for point in [[0.0, 0.0], [25e3, -18e3], [-400.0, 31.5]] {
            let [latitude, longitude] = plane.unproject(point);
            let [east_m, north_m] = plane.project(latitude, longitude);
            assert!((east_m - point[0]).abs() < 1e-5 && (north_m - point[1]).abs() < 1e-5);
        }
    }
}

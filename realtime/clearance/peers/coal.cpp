// coal 3: least distance of an arm to obstacles held in a dynamic AABB tree, and to itself; poses included.
//
// Reads one file (see benches/peers.rs, `write_case`), says `ready`, then answers one line a request, as
// `distance free capsules`, `distance anywhere hulls`, `clear anywhere hulls`: nanoseconds a position, of those that
// touch nothing or of all; `mean anywhere hulls`: mean of the least distances, overlap counted as 0.
#include <algorithm>
#include <chrono>
#include <fstream>
#include <iostream>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <coal/broadphase/broadphase_dynamic_AABB_tree.h>
#include <coal/broadphase/default_broadphase_callbacks.h>
#include <coal/collision.h>
#include <coal/distance.h>
#include <coal/shape/convex.h>
#include <coal/shape/geometric_shapes.h>

using Pose = Eigen::Isometry3d;
using Vector = Eigen::Vector3d;
using Shape = std::shared_ptr<coal::CollisionGeometry>;
using Positions = std::vector<std::vector<double>>;

struct Joint { Pose parent_from_joint; Vector axis; };
struct Link { size_t joint; Pose link_from_capsule; Shape capsule, hull; };

static std::vector<Joint> joints;
static std::vector<Link> links;
static std::vector<std::pair<size_t, size_t>> pairs;
static Positions anywhere;
// With capsules, with hulls.
static Positions touching_nothing[2];
static std::vector<std::unique_ptr<coal::CollisionObject>> obstacles;

static Vector read_vector(std::istream& in) {
    Vector v;
    in >> v.x() >> v.y() >> v.z();
    return v;
}

static Pose read_pose(std::istream& in) {
    Pose pose = Pose::Identity();
    pose.translation() = read_vector(in);
    double x, y, z, w;
    in >> x >> y >> z >> w;
    pose.linear() = Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
    return pose;
}

static Shape read_capsule(std::istream& in, Pose& pose) {
    const Vector a = read_vector(in), b = read_vector(in);
    double radius;
    in >> radius;
    pose = Pose::Identity();
    pose.translation() = 0.5 * (a + b);
    pose.linear() = Eigen::Quaterniond::FromTwoVectors(Vector::UnitZ(), b - a).toRotationMatrix();
    return std::make_shared<coal::Capsule>(radius, (b - a).norm());
}

static Shape read_hull(std::istream& in) {
    unsigned count;
    in >> count;
    auto points = std::make_shared<std::vector<coal::Vec3s>>();
    for (unsigned k = 0; k < count; ++k) points->push_back(read_vector(in));
    return Shape(coal::ConvexBase::convexHull(points, count, true));
}

static coal::Transform3s placed(const Pose& pose) { return coal::Transform3s(pose.linear(), pose.translation()); }

static void read(const char* file) {
    std::ifstream in(file);
    std::string what;
    while (in >> what) {
        if (what == "joint") {
            const Pose pose = read_pose(in);
            joints.push_back({pose, read_vector(in)});
        } else if (what == "link") {
            Link link;
            in >> link.joint;
            link.capsule = read_capsule(in, link.link_from_capsule);
            link.hull = read_hull(in);
            links.push_back(link);
        } else if (what == "pair") {
            size_t a, b;
            in >> a >> b;
            pairs.emplace_back(a, b);
        } else if (what == "at") {
            bool is_free[2];
            in >> is_free[0] >> is_free[1];
            std::vector<double> position(joints.size());
            for (double& q : position) in >> q;
            anywhere.push_back(position);
            for (int hulls : {0, 1}) {
                if (is_free[hulls]) touching_nothing[hulls].push_back(position);
            }
        } else {
            Shape shape;
            Pose pose;
            if (what == "box") {
                const Vector half = read_vector(in);
                shape = std::make_shared<coal::Box>(2.0 * half.x(), 2.0 * half.y(), 2.0 * half.z());
                pose = read_pose(in);
            } else if (what == "cylinder" || what == "rod") {
                double radius, half;
                in >> radius >> half;
                if (what == "rod") shape = std::make_shared<coal::Capsule>(radius, 2.0 * half);
                else shape = std::make_shared<coal::Cylinder>(radius, 2.0 * half);
                pose = read_pose(in);
            } else if (what == "sphere") {
                double radius;
                in >> radius;
                shape = std::make_shared<coal::Sphere>(radius);
                pose = read_pose(in);
            } else {
                shape = read_capsule(in, pose);
            }
            obstacles.push_back(std::make_unique<coal::CollisionObject>(shape, placed(pose)));
        }
    }
}

// One result for all links, so that what one has found prunes the others; once something overlaps all is told.
struct Nearest : coal::DistanceCallBackBase {
    const coal::DistanceRequest request{true, false};
    coal::DistanceResult result;
    void init() override {}
    bool distance(coal::CollisionObject* a, coal::CollisionObject* b, coal::CoalScalar& least) override {
        // Into a result of its own: handed one that holds a distance already, coal 3.0.3 overlooks nearer pairs.
        coal::DistanceResult found;
        coal::distance(a, b, request, found);
        result.update(found);
        least = result.min_distance;
        return least <= 0.0;
    }
};

struct Arm {
    bool hulls;
    std::vector<std::unique_ptr<coal::CollisionObject>> objects;
    std::vector<Pose> frames;
    coal::DynamicAABBTreeCollisionManager tree;

    explicit Arm(bool hulls) : hulls(hulls), frames(joints.size() + 1, Pose::Identity()) {
        for (const Link& link : links) {
            objects.push_back(std::make_unique<coal::CollisionObject>(hulls ? link.hull : link.capsule));
        }
        for (auto& obstacle : obstacles) tree.registerObject(obstacle.get());
        tree.setup();
    }

    void place(const std::vector<double>& position) {
        for (size_t k = 0; k < joints.size(); ++k) {
            frames[k + 1] = frames[k] * joints[k].parent_from_joint * Eigen::AngleAxisd(position[k], joints[k].axis);
        }
        for (size_t k = 0; k < links.size(); ++k) {
            const Pose& frame = frames[links[k].joint];
            objects[k]->setTransform(placed(hulls ? frame : frame * links[k].link_from_capsule));
            objects[k]->computeAABB();
        }
    }

    double distance(const std::vector<double>& position) {
        place(position);
        Nearest call;
        // From the tool inwards, as what is nearest is mostly there.
        for (size_t k = links.size(); k-- > 0;) {
            if (links[k].joint > 0 && call.result.min_distance > 0.0) tree.distance(objects[k].get(), &call);
        }
        double least = call.result.min_distance;
        for (const auto& [a, b] : pairs) {
            const coal::AABB &first = objects[a]->getAABB(), &second = objects[b]->getAABB();
            if (first.distance(second) >= least) continue;
            coal::DistanceResult result;
            coal::distance(objects[a].get(), objects[b].get(), call.request, result);
            least = std::min(least, result.min_distance);
        }
        return least;
    }

    bool clear(const std::vector<double>& position) {
        place(position);
        for (size_t k = links.size(); k-- > 0;) {
            if (links[k].joint == 0) continue;
            coal::CollisionCallBackDefault call;
            tree.collide(objects[k].get(), &call);
            if (call.data.result.isCollision()) return false;
        }
        for (const auto& [a, b] : pairs) {
            if (!objects[a]->getAABB().overlap(objects[b]->getAABB())) continue;
            coal::CollisionRequest request;
            coal::CollisionResult result;
            if (coal::collide(objects[a].get(), objects[b].get(), request, result) > 0) return false;
        }
        return true;
    }
};

template <class Call> static double per_position(const Positions& positions, Call call) {
    double least = std::numeric_limits<double>::infinity();
    for (int pass = 0; pass < 3; ++pass) {
        const auto began = std::chrono::steady_clock::now();
        volatile double sum = 0.0;
        for (const auto& position : positions) sum = sum + call(position);
        const std::chrono::duration<double, std::nano> took = std::chrono::steady_clock::now() - began;
        least = std::min(least, took.count() / positions.size());
    }
    return least;
}

int main(int, char** arguments) {
    read(arguments[1]);
    Arm capsules(false), hulls(true);
    std::cout.precision(12);
    std::cout << "ready" << std::endl;
    std::string what, where, with;
    while (std::cin >> what >> where >> with) {
        Arm& arm = with == "hulls" ? hulls : capsules;
        const Positions& positions = where == "free" ? touching_nothing[with == "hulls"] : anywhere;
        if (what == "distance") {
            std::cout << per_position(positions, [&](const auto& at) { return arm.distance(at); }) << std::endl;
        } else if (what == "clear") {
            std::cout << per_position(positions, [&](const auto& at) { return arm.clear(at); }) << std::endl;
        } else {
            double sum = 0.0;
            for (const auto& position : positions) sum += std::max(0.0, arm.distance(position));
            std::cout << sum / positions.size() << std::endl;
        }
    }
}

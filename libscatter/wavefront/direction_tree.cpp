#include <scatter/optics/errors.hpp>
#include <scatter/wavefront/direction_tree.hpp>

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace scatter::wavefront {

struct DirectionTree::Implementation {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::vector<RTCBounds> bounds;
};

namespace {

struct Query {
  RTCIntersectContext context;
  std::vector<int>* found;
};

void bounds_of(const RTCBoundsFunctionArguments* arguments) {
  *arguments->bounds_o =
      static_cast<const std::vector<RTCBounds>*>(arguments->geometryUserPtr)->at(arguments->primID);
}

// Never reports a hit, so that Embree goes on to every box that the ray meets.
void note_box(const RTCIntersectFunctionNArguments* arguments) {
  if (arguments->valid[0] == 0) return;
  static_cast<void>(arguments->geometryUserPtr);
  reinterpret_cast<Query*>(arguments->context)->found->push_back(static_cast<int>(arguments->primID));
}

float rounded_down(double x) {
  return std::nextafter(static_cast<float>(x), -std::numeric_limits<float>::infinity());
}
float rounded_up(double x) {
  return std::nextafter(static_cast<float>(x), std::numeric_limits<float>::infinity());
}

} // namespace

DirectionTree::DirectionTree(std::span<const DirectionBox> boxes) : implementation_(new Implementation) {
  Implementation& tree = *implementation_;
  tree.bounds.reserve(boxes.size());
  for (const DirectionBox& box : boxes) {
    double extent2 = 0;
    for (int axis = 0; axis < 3; ++axis) extent2 += std::pow(std::max(box.hi[axis] - box.lo[axis], 0.0), 2);
    // A chord of length c sags by at most c^2/8 below the sphere while c <= 1; wider boxes take the whole
    // sphere. The float error of Embree's own box test is below 1e-6 for unit directions.
    const double pad = extent2 < 0.25 ? extent2 / 4 + 1e-6 : 2.0;
    const bool empty = box.lo[0] > box.hi[0];
    RTCBounds b{};
    b.lower_x = empty ? 3.0F : rounded_down(box.lo[0] - pad);
    b.lower_y = empty ? 3.0F : rounded_down(box.lo[1] - pad);
    b.lower_z = empty ? 3.0F : rounded_down(box.lo[2] - pad);
    b.upper_x = empty ? 3.0F : rounded_up(box.hi[0] + pad);
    b.upper_y = empty ? 3.0F : rounded_up(box.hi[1] + pad);
    b.upper_z = empty ? 3.0F : rounded_up(box.hi[2] + pad);
    tree.bounds.push_back(b);
  }
  tree.device = rtcNewDevice(nullptr);
  if (tree.device == nullptr)
    throw RunError("Embree failed to start: error " + std::to_string(rtcGetDeviceError(nullptr)));
  tree.scene = rtcNewScene(tree.device);
  RTCGeometry geometry = rtcNewGeometry(tree.device, RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(tree.bounds.size()));
  rtcSetGeometryUserData(geometry, &tree.bounds);
  rtcSetGeometryBoundsFunction(geometry, bounds_of, nullptr);
  rtcSetGeometryIntersectFunction(geometry, note_box);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(tree.scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcSetSceneFlags(tree.scene, RTC_SCENE_FLAG_ROBUST);
  rtcCommitScene(tree.scene);
  if (const RTCError error = rtcGetDeviceError(tree.device); error != RTC_ERROR_NONE)
    throw RunError("Embree failed to build its tree: error " + std::to_string(error));
}

DirectionTree::~DirectionTree() {
  if (implementation_->scene != nullptr) rtcReleaseScene(implementation_->scene);
  if (implementation_->device != nullptr) rtcReleaseDevice(implementation_->device);
}

void DirectionTree::find(const std::array<double, 3>& direction, std::vector<int>& found) const {
  found.clear();
  Query query{};
  rtcInitIntersectContext(&query.context);
  query.found = &found;
  // Boxes hold points of the sphere and a little of its inside: look between 0.4 and 1.6 radii.
  RTCRayHit ray{};
  ray.ray.dir_x = static_cast<float>(direction[0]);
  ray.ray.dir_y = static_cast<float>(direction[1]);
  ray.ray.dir_z = static_cast<float>(direction[2]);
  ray.ray.tnear = 0.4F;
  ray.ray.tfar = 1.6F;
  ray.ray.mask = ~0U;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(implementation_->scene, &query.context, &ray);
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
}

} // namespace scatter::wavefront

// The whole of perception on one core, stage by stage, with its memory kept between scans.
#pragma once

#include <cstdint>

#include "circles.hpp"
#include "footprint.hpp"
#include "groups.hpp"
#include "outline.hpp"
#include "patches.hpp"
#include "projection.hpp"
#include "range_image.hpp"
#include "scanner.hpp"
#include "segmentation.hpp"
#include "strips.hpp"

namespace twinscrew {

class Kernel {
 public:
  Kernel(const Scanner& scanner, const Gates& gates, const Criterion& criterion, float reach,
             const MergeRule& merge, const FootprintRule& footprint, const CircleRules& rules,
         float strip_gap, int sector, bool wide = has_eight_lanes())
      : scanner_(scanner),
        image_(scanner.rows(), scanner.columns()),
        projection_(scanner_, gates, Plane::of(reach, merge.across), wide),
        segmentation_(scanner_, criterion, image_.size()),
        patches_(Plane::of(reach, merge.across), merge, strip_gap, image_.size()),
        groups_(image_.size()),
        footprints_(footprint, image_.size()),
        circles_(rules, image_.size()),
        strips_({strip_gap, gates.range_max - strip_gap}, image_.size()),
        outline_(scanner_, sector, gates.range_max) {}
  Kernel(const Kernel&) = delete;  // the stages refer to the scanner beside them
  Kernel& operator=(const Kernel&) = delete;

  // X_BS places the sensor on the vessel, R_LB levels the vessel's frame; motion may be null.
  Counts project(const Cloud& cloud, const Transform& X_BS, const Matrix& R_LB,
                 const Motion* motion) {
    X_LS_ = product(R_LB, X_BS);
    return projection_(cloud, X_BS, R_LB, motion, image_);
  }

  std::int32_t segment() { return components_ = segmentation_(image_, scanner_.wraps()); }

  const std::vector<Circle>& objects() {
    patches_(image_, segmentation_, components_);
    groups_(patches_);
    for (int pass = 0; pass < PASSES && footprints_(groups_, patches_); ++pass) groups_(patches_);
    circles_(image_, patches_, groups_);
    return circles_.circles();
  }

  // Of the circles that `objects` found.
  const std::vector<Strip>& strips() {
    return strips_(image_, patches_, circles_, scanner_.wraps());
  }

  // The boundary of the free water, with the cut object, if any, whose piece `objects` found there.
  const std::vector<BoundaryPoint>& outline() {
    return outline_(image_, X_LS_, [&](std::size_t cell) {
      const std::int32_t circle = circle_of(cell);
      return circle < 0 ? -1 : circles_.circles()[static_cast<std::size_t>(circle)].cut_from;
    });
  }

  // From the sensor to the levelled frame L, in the last scan.
  const Transform& X_LS() const { return X_LS_; }

  std::size_t circles() const { return circles_.circles().size(); }
  const RangeImage& image() const { return image_; }
  std::int32_t label(std::size_t cell) const { return segmentation_.label(cell); }
  std::int32_t circle_of(std::size_t cell) const { return circles_.circle_of(patches_, cell); }

 private:
  static constexpr int PASSES = 3;  // a vessel in more pieces than 2^3 is rare

  Scanner scanner_;
  Transform X_LS_{};
  RangeImage image_;
  Projection projection_;
  Segmentation segmentation_;
  PatchMap patches_;
  Groups groups_;
  Footprints footprints_;
  Circles circles_;
  Strips strips_;
  Outline outline_;
  std::int32_t components_ = 0;
};

}  // namespace twinscrew

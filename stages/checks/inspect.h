// stages/checks/inspect.h: inspects the layers of a powder job for faults to know before printing: unsupported pieces, bodies
// that belong to no part, hollows full of powder, thin material and gaps, parts that grow together, parts at the edge of the
// bed.
//
// codes   islands      pieces of layers with nothing below that are not the bottom of a part
//         loose        bodies without the bottom of a part: they fall off
//         hollows      powder that no way leads out from, more than a cube of the least width
//         drains       hollows that open through less than a drain's width
//         thin         walls and pins narrower than the least width, within layers
//         roofs        material that is thinner along z
//         gaps         powder between material that is narrower, within layers or along z
//         contacts     bodies that meet in an edge, a corner or a narrower neck
//         touching     parts that grow together
//         bed-edge     layers that reach the edge of the image
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stages/checks/bodies.h"
#include "stages/checks/measures.h"
#include "stages/checks/solid_checks.h"
#include "stages/checks/thin.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/mesh.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina::checks {

/// Where something is: the middle of its box.
struct Spot {
  double x_mm = 0, y_mm = 0;  // from the left and from the front of the bed
  std::uint32_t layer = 0;    // the first
  double z_mm = 0;            // bottom of that layer
};

/// One of a kind: what it holds, and the box around it.
struct Location {
  double amount = 0;  // as Found::amount
  Spot spot;
  std::array<double, 4> box_mm{};   // left, front, right, back, from the left and the front of the bed
  std::uint32_t last_layer = 0;     // the first is the spot's
  std::uint32_t part = UINT32_MAX;  // of the job; UINT32_MAX: its middle is in the box of none
};

/// Some of one kind.
struct Found {
  std::uint64_t count = 0;          // pieces or bodies
  double amount = 0;                // of all: mm2, or mm3 of bodies
  double largest = 0;               // the same of the largest
  Spot spot;                        // of the largest, the first of equals
  std::uint32_t layers = 0;         // that contain islands; of other kinds none
  std::vector<Location> locations;  // the largest, at most kMax: the largest first, equal ones from the bottom up

  static constexpr std::size_t kMax = 20;
  void note_location(const Location& position);
  /// Puts places in their order.
  void sort_locations();
};

struct Findings {
  std::uint32_t layers = 0;  // inspected
  Found islands, loose, hollows, drains, thin, roofs, gaps, contacts;
  struct Touching {
    std::uint32_t part = 0, other = 0;  // of the job; equal for copies of one
    Spot spot;
  };
  std::vector<Touching> touching;  // each pair of parts once, the first kMax
  std::optional<Spot> bed_edge;    // of the first layer that reaches it
  struct Stop {
    std::uint32_t layer = 0;  // the first that was not inspected
    double z_mm = 0;          // its bottom
    std::uint64_t bytes = 0;  // minimum to inspect it
  };
  std::optional<Stop> stop;  // for want of memory
  static constexpr std::size_t kMax = 20;
};

/// The inspection of a layer on its own, before its turn; kept from layer to layer.
struct LayerInspection {
  Runs image;
  LayerMeasures measures;
  std::uint64_t min_bytes = 0;  // to inspect it, if above the limit: then the rest is empty
  std::uint64_t bytes() const { return bytes_of(image) + measures.bytes(); }
};

/// Layers are given from the bottom up, without gaps; images as sections are, before mirrors, bleed and doses.
/// memory  two layers' runs with their numbers and bodies. Where these and the inspection of a layer exceed the limit, the
///         inspection stops and frees its memory; where it stops depends on the images alone
/// cost    O(runs) a layer for all but discs (thin.h)
class Inspection {
 public:
  /// grid          of the images; must outlive this object
  /// placed_parts  the boxes of all copies; a piece at the bottom of one is not an island
  /// min_nm        the width below which material and gaps are thin; 0: none is
  /// drain_nm      the width below which powder does not leave a hollow; 0: any lets it out
  /// max_bytes     limit of memory, with the inspection of one layer
  Inspection(const PixelGrid& grid, std::vector<checks::Solid> placed_parts, std::int64_t min_nm, std::int64_t drain_nm,
             std::uint64_t max_bytes = UINT64_MAX);

  // --- from any thread
  /// About what prepare() adds to what a layer holds.
  std::uint64_t bytes_needed(const RunsView& image) const;
  /// Keeps the rows of the image that parts can reach, and measures its widths.
  void prepare(const RunsView& image, LayerInspection& inspection) const;
  /// After prepare(), as often as there are samples: Measures::add_sample().
  void add_sample(const RunsView& sample, LayerInspection& inspection) const;

  // --- in layer order
  /// Inspects no more layers, and frees its memory.
  void leave();
  void add(const Layer& layer, const LayerInspection& inspection);
  /// After the last layer.
  const Findings& finish();
  const Findings& findings() const { return findings_; }

  /// Held by prepare() and add_sample(), for as many layers as they work on at a time.
  std::uint64_t scratch_bytes() const;
  /// Without that and LayerInspection.
  std::uint64_t bytes() const { return solid_.bytes() + powder_.bytes() + measures_.bytes(); }

 private:
  struct Solids;
  struct Powder;

  Spot spot(const PixelBox& box, std::uint32_t layer, std::int64_t z) const;
  Location position(const PixelBox& box, const Spot& at, double amount, std::uint32_t last_layer) const;
  void note_body(Found& found, const Body& body, double amount, std::uint32_t last_layer);
  void note_measured();
  void name_parts(Found& found) const;
  void stop(const Layer& layer, std::uint64_t bytes);
  bool is_in(std::uint32_t placed_part, const Body& body) const;
  std::uint32_t owner_of(const Body& body, std::int64_t from, std::int64_t to) const;
  std::uint32_t first_of_several(const Body& body);
  void note_touching(std::uint32_t a, std::uint32_t b, const PixelBox& within, const Layer& layer);
  void note_outgrown(const Layer& layer);
  void note_edges(const Layer& layer, const RunsView& image);

  /// Scratch that no layer uses now, or new one; it returns when it is no longer used.
  class BorrowedScratch {
   public:
    explicit BorrowedScratch(const Inspection& inspection);
    ~BorrowedScratch();
    BorrowedScratch(const BorrowedScratch&) = delete;
    ThinScratch& operator*() { return *scratch_; }

   private:
    const Inspection& inspection_;
    std::unique_ptr<ThinScratch> scratch_;
  };

  const PixelGrid& grid_;
  mutable std::mutex scratch_mutex_;
  mutable std::vector<std::unique_ptr<ThinScratch>> scratch_;
  std::vector<checks::Solid> placed_parts_;  // by bottom
  std::vector<PixelBox> window_;
  PixelBox all_;           // of all placed parts, as wide as Measures needs
  std::uint32_t top_ = 0;  // image row that is row 0 of the boxes here: rows above and below the parts are left out
  Measures measures_;
  double min_mm_, pixel_mm2_;
  std::uint64_t max_bytes_;
  std::atomic<bool> stopped_ = false;
  std::int64_t below_ = 0;  // bottom of the layer before
  bool holds_ = false;      // any layer so far
  Layer layer_{};
  Follower solid_{true}, powder_{false};
  Findings findings_;
};

/// One warning for each kind. part  names of files
void report(const Findings& findings, std::span<const std::string> part, double min_mm, double drain_mm,
            std::vector<Warning>& warnings);

}  // namespace lamina::checks

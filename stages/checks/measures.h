// stages/checks/measures.h: material and gaps that are too narrow, in all directions, and hollows whose drains are.
//
// Within a layer octagonal discs measure width (thin.h), along z columns do (columns.h). With w the minimum:
//   thin      regions in which no disc of w fits within a layer: walls and pins. Each pixel column of them has a height, and is
//             attached where material that is wide enough is below or above. Half of a body must be detached, or its columns
//             must be 1.5 w tall on average, or some 3 w: ridges and cones above about 20 degrees are sharp, not thin. Chips
//             are left out: the cube of a body's longest side is at least four times its volume
//   roofs     columns of material shorter than w, where a disc of 2 w fits into those of 2 w of height
//   gaps      the same two in powder; columns that powder joins to the edge of the window are no gap. Discs are of 3 w.
//             Gaps between pixels too: points between pixels that are in powder, though all pixels around are set, also in the
//             layers below and above; 2 w long and w wide
//   contacts  wide parts of a layer that meet in less than w (thin.h), over a height of 2 w
//   drains    positions of a disc of the drain's width, 0.6 of it high, in powder: a body of them, at least a cube of that
//   width,
//             that does not reach the outside, in a hollow that does
//
// cost    O(runs) a layer and that of discs; memory of the images of the last layers, as many as
//         twice the minimum wall or 0.6 of the drain takes; of equal ones once for the minimum wall
#pragma once

#include <cstdint>
#include <vector>

#include "stages/checks/bodies.h"
#include "stages/checks/columns.h"
#include "stages/checks/short_spans.h"
#include "stages/checks/sliding_window.h"
#include "stages/checks/thin.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"

namespace lamina::checks {

/// What is measured within a layer, before its turn.
struct LayerMeasures {
  Runs powder;    // between the parts, within the window
  Runs channels;  // corners of drains in it
  Runs necks;
  Widths solid, gaps;
  Runs inner;    // pixels of the solid without an edge nearby
  Runs sampled;  // where all samples between pixels are set
  bool has_sample = false;
  Necks scratch;
  std::uint64_t bytes() const {
    return bytes_of(powder) + bytes_of(channels) + bytes_of(necks) + solid.bytes() + gaps.bytes() + bytes_of(inner) +
           bytes_of(sampled) + scratch.bytes();
  }
  std::uint64_t run_bytes() const;  // without capacity to spare
};

enum class Measured : std::uint8_t { kThin, kRoof, kGap, kContact, kDrain };

class Measures {
 public:
  struct Item {
    Measured kind;
    Body body;
    std::uint64_t pixels;  // in plan view; of drains 0
    double pixel_nm;       // of drains: volume, about
  };

  Measures(const PixelGrid& grid, std::int64_t min_nm, std::int64_t drain_nm);

  /// So many pixels around the parts belong to the window.
  std::uint32_t margin() const;
  /// Images have the rows [0, bottom) of the window, and all columns.
  void set_window(const PixelBox& window) {
    window_ = window;
    rows_ = window.bottom;
  }

  // --- from any thread
  void prepare(const RunsView& image, ThinScratch& scratch, LayerMeasures& measures) const;

  /// After prepare(). sample  the section at points that are less than a pixel and a layer from those of the image
  void add_sample(const RunsView& sample, ThinScratch& scratch, LayerMeasures& measures) const;

  // --- in layer order
  /// Bytes that add() needs about.
  std::uint64_t need(const RunsView& image, const LayerMeasures& measures) const;
  /// below   the image of the layer below; empty: there is none
  /// powder  its bodies, of the layers below
  void add(const Layer& layer, const RunsView& image, const RunsView& below, const LayerMeasures& measures, Follower& powder);
  /// Ends what does not depend on layers above.
  void finish();
  /// Two bodies of powder become one, or one ends; open  it leads outside.
  void join_powder(std::uint32_t stays, std::uint32_t ends);
  void end_powder(std::uint32_t owner, bool open);

  /// Found so far; the caller takes and clears them.
  std::vector<Item>& found() { return found_; }
  std::uint64_t bytes() const;

 private:
  /// Columns of regions that are narrow in their layers.
  struct Upright {
    Columns columns;
    ColumnBodies bodies;
    Runs base, next_base;  // in rows in which columns begin or end: what they are attached to
    Runs below;            // narrow in the layer below
    Buffer<ColumnSpan> ended;
    std::uint64_t bytes() const {
      return columns.bytes() + bodies.bytes() + bytes_of(base) + bytes_of(next_base) + bytes_of(below) + bytes_held(ended);
    }
  };
  /// Columns that are short.
  struct ShortColumns {
    ColumnBodies bodies;
    SlidingWindow footprints{SetOperation::kUnion};  // of the last layers
    Runs footprint, near, wide;
    Buffer<ColumnSpan> ended, within;
    ThinScratch scratch;
    std::uint64_t bytes() const;
  };
  struct EndUpright;
  struct EndFlat;
  struct EndChannel;
  struct EndNeck;
  struct EndHidden;
  struct Pocket {
    Item item;
    std::uint32_t next, tail;
  };

  void add_upright(const Layer& layer, const RunsView& image, const RunsView& below, const RunsView& narrow, Measured kind,
                   Upright& upright);
  void end_flat(const Layer& layer, std::span<const ColumnSpan> ended, Measured kind, ShortColumns& flat);
  void add_hidden(const LayerMeasures& measures);
  void note_hidden(const RunsView& inner);
  void add_channels(const Layer& layer, const RunsView& channels, Follower& powder);
  void keep_pocket(const Item& item, Follower& powder, std::uint32_t column, std::uint32_t row);
  double longest_nm(const Body& body) const;

  std::int64_t min_nm_, drain_nm_;
  double column_nm_, row_nm_;
  Stencils widths_, drains_, roofs_, slots_;
  Stencil drain_, roof_, slot_;
  PixelBox window_{0, 0, 0, 0};
  bool begun_ = false;
  Layer latest_{};
  std::uint32_t columns_ = 0, rows_ = 0;

  Upright thin_, slots_upright_;
  ShortSpans short_;
  ShortColumns roofs_flat_, gaps_flat_;
  SlidingWindow channel_columns_{SetOperation::kIntersection};  // by the top of a layer
  Follower channels_{false}, necks_{true}, hidden_{true};
  Runs inner_, both_inner_,
      sampled_;              // inner pixels of the layer below, and those of it that are also two layers below; samples
  bool has_sample_ = false;  // of the layer below
  Runs between_layers_, row_;
  std::vector<Pocket> pockets_;
  std::vector<std::uint32_t> free_;
  std::vector<Item> found_;
};

}  // namespace lamina::checks

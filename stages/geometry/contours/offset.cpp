#include "stages/geometry/contours/offset.h"

#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/contact.h"
#include "stages/geometry/contours/curve.h"
#include "stages/geometry/contours/nest.h"
#include "stages/geometry/contours/order.h"
#include "stages/geometry/contours/tidy.h"

namespace lamina {
namespace {

/// Buffers of offset_mitered, reused from piece to piece.
struct Scratch {
  Contours curves;
  ContactScratch contact;
  Buffer<std::uint32_t> group;
};

/// Appends the region of contours [begin, end), whose curves meet those of no other contour. clean  so are the contours
Status append_piece(const ContoursView& contours, std::uint32_t begin, std::uint32_t end, bool clean, OffsetCurve& curve,
                    Scratch& scratch, Contours& out) {
  Contours& curves = scratch.curves;
  curves.clear();
  bool plain = clean;
  for (std::uint32_t c = begin; c < end; ++c) plain &= curve.append(contours[c], curves);
  if (plain) tidy(curves);
  if (!plain || find_contacts(curves, scratch.contact, scratch.group)) {
    const auto united = unite_curves(curves);
    if (!united) return united.error();
    out.append(*united);
    return {};
  }
  scratch.group.clear();
  if (const auto nested = nest(curves, FillRule::kPositive, scratch.group); !nested) return nested.error();
  order_by_outer(curves);
  out.append(curves);
  return {};
}

}  // namespace

Result<Contours> offset_mitered(const ContoursView& contours, std::int64_t distance) {
  OffsetCurve curve(static_cast<double>(distance));
  Scratch scratch;
  Contours out;
  const bool ordered = is_ordered_by_outer(contours);
  for (std::uint32_t begin = 0, end = 0; begin < contours.size(); begin = end) {
    // Outer contours that shrink, each with its holes, stay apart.
    end = distance < 0 && ordered ? begin + 1 : contours.size();
    while (end < contours.size() && doubled_area(contours[end]) < 0) ++end;
    if (Status status = append_piece(contours, begin, end, ordered, curve, scratch, out); !status) return status.error();
  }
  return out;
}

}  // namespace lamina

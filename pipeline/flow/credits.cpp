#include "pipeline/flow/credits.h"

namespace lamina::pipeline {

using Phase = LayerState::Phase;

Credits::Credits(const LayerSteps& steps, const FlowLimits& limits, const std::function<bool()>& stopped)
    : steps_(steps),
      stopped_(stopped),
      budget_(limits.budget_bytes, limits.max_in_flight, steps.let_go),
      layers_(limits.record_slots) {
  for (std::uint32_t slot = limits.record_slots; slot-- > 0;) free_.push_back(slot);
  waiting_.reserve(limits.record_slots);
  leaving_.reserve(limits.record_slots);
}

Credits::Leaving Credits::begin(std::uint32_t position) {
  leaving_.clear();
  const std::uint32_t slot = free_.back();
  free_.pop_back();
  layers_[slot] = {{position, 0, slot}};
  layers_[slot].estimate = steps_.bytes_of(position);
  waiting_.push_back(&layers_[slot]);
  return wake();
}

Credits::Leaving Credits::receive(LayerState& layer) {
  leaving_.clear();
  if (layer.phase == Phase::kRecorded) {
    if (layer.ticket.position >= recorded_from_) budget_.hold_extra(layer.extra), recorded_from_ = layer.ticket.position;
    if (layer.loan) budget_.give_back(*layer.loan, steps_.bytes_held(layer.ticket.work));
    free_.push_back(layer.ticket.record);
    ++recorded_;
  } else if (layer.phase == Phase::kDone) {
    take_back(layer);
    leaving_.push_back(&layer);
  } else {
    if (layer.held > layer.loan->bytes) budget_.settle(*layer.loan, layer.held);
    const auto younger = [&](const LayerState* other) { return other->ticket.position > layer.ticket.position; };
    waiting_.insert(std::ranges::find_if(waiting_, younger), &layer);
  }
  return wake();
}

/// Takes back what a layer that is done no longer holds.
void Credits::take_back(LayerState& layer) {
  if (layer.status) {
    admission_.learn(layer.estimate, layer.held);
    whole_.learn(layer.estimate + layer.more, layer.held);
    oversized_ += layer.held > budget_.bytes() ? 1 : 0;
  }
  const std::uint64_t retained = steps_.bytes_held(layer.ticket.work);
  if (steps_.records_from_work) return budget_.settle(*layer.loan, retained);
  budget_.give_back(*layer.loan, retained);
  layer.loan.reset();
}

bool Credits::admit(LayerState& layer) {
  if (stopped_()) {
    layer.status = Error{Fault::kInterrupted, "interrupted"};
    layer.phase = Phase::kDone;
    return true;
  }
  layer.loan = budget_.take(admission_(layer.estimate));
  if (!layer.loan) return false;
  layer.ticket.work = layer.loan->slot;
  layer.phase = Phase::kStepping;
  return true;
}

/// Whether a layer may take its next step now; raises its loan to what the step needs.
bool Credits::may_continue(LayerState& layer) {
  std::uint64_t bytes = layer.loan->bytes;
  if (layer.needs_more) bytes = std::max(layer.held, whole_(layer.estimate + layer.more));
  const std::uint64_t added = bytes > layer.loan->bytes ? bytes - layer.loan->bytes : 0;
  if (layer.ticket.position != recorded_ && !budget_.fits(added)) return false;
  budget_.settle(*layer.loan, bytes);
  layer.needs_more = false;
  return true;
}

Credits::Leaving Credits::wake() {
  bool held_up = false;
  std::size_t kept = 0, next = 0;
  for (; next < waiting_.size(); ++next) {
    LayerState* const layer = waiting_[next];
    if (layer->phase == Phase::kArrived) {
      if (!admit(*layer)) break;
    } else if ((held_up && layer->needs_more) || !may_continue(*layer)) {
      held_up = true;
      waiting_[kept++] = layer;
      continue;
    }
    leaving_.push_back(layer);
  }
  waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(kept), waiting_.begin() + static_cast<std::ptrdiff_t>(next));
  return leaving_;
}

}  // namespace lamina::pipeline

// What the thread sanitizer has to be told about TBB, whose library is not instrumented: that a job happens after what
// came before it was started, and before what comes after it was waited for. Included before everything else in builds
// with the thread sanitizer (cmake/Flags.cmake), where the name `tbb` then means the wrappers below.
//
// Jobs that run side by side get no order among them: their races are found. Stages of a pipeline are the exception:
// every stage waits for all that ended before it began.
#pragma once
// All of it: no header of TBB may come after the name is another's.
#include <tbb/tbb.h>

#include <algorithm>
#include <memory>
#include <type_traits>
#include <utility>

extern "C" {
void __tsan_acquire(void* address);
void __tsan_release(void* address);
}

namespace annotated_tbb {
using namespace ::tbb;

/// Two places the sanitizer remembers times by.
struct Order {
  char begun = 0, ended = 0;
};

/// A job that stays where the caller has it; TBB copies nothing but this around. Not instrumented: TBB's hands have no
/// order the sanitizer could see.
template <class Body>
struct Job {
  Body* body;
  Order* order;
  template <class... Arguments>
  __attribute__((no_sanitize("thread"))) auto operator()(Arguments&&... arguments) const {
    __tsan_acquire(&order->begun);
    if constexpr (std::is_void_v<decltype((*body)(std::forward<Arguments>(arguments)...))>) {
      (*body)(std::forward<Arguments>(arguments)...);
      __tsan_release(&order->ended);
    } else {
      auto result = (*body)(std::forward<Arguments>(arguments)...);
      __tsan_release(&order->ended);
      return result;
    }
  }
};

template <class Body>
Job<std::remove_reference_t<Body>> job(Body& body, Order& order) {
  return {&body, &order};
}

/// TBB counts the jobs that are left in a word on the stack, right below the caller's frame, and the last worker writes
/// it after its job. Waiting for it happens inside of TBB; without this, whatever uses that part of the stack next
/// would seem to race with the worker.
inline void come_after_counts_below(char* frame) {
  constexpr int kReach = 4096;
  for (int below = 0; below < kReach; below += 8) __tsan_acquire(frame - below);
}

/// Runs start() between what the caller did and will do; exceptions end jobs, too.
template <class Start>
__attribute__((noinline)) auto ordered(Order& order, const Start& start) {
  struct Join {
    Order& order;
    char* frame;
    ~Join() {
      __tsan_acquire(&order.ended);
      come_after_counts_below(frame);
    }
  } join{order, static_cast<char*>(__builtin_frame_address(0))};
  __tsan_release(&order.begun);
  return start();
}

template <class Range, class Body>
void parallel_for(const Range& range, const Body& body) {
  Order order;
  ordered(order, [&] { ::tbb::parallel_for(range, job(body, order)); });
}
template <class Range, class Body, class Partitioner>
requires(!std::is_integral_v<Range>) void parallel_for(const Range& range, const Body& body,
                                                       Partitioner&& partitioner) {
  Order order;
  ordered(order, [&] { ::tbb::parallel_for(range, job(body, order), std::forward<Partitioner>(partitioner)); });
}
template <class Index, class Body>
requires std::is_integral_v<Index>
void parallel_for(Index first, Index last, const Body& body) {
  Order order;
  ordered(order, [&] { ::tbb::parallel_for(first, last, job(body, order)); });
}

template <class... Bodies>
void parallel_invoke(const Bodies&... bodies) {
  Order order;
  ordered(order, [&] { ::tbb::parallel_invoke(job(bodies, order)...); });
}

/// In the caller's thread: TBB's own threads would have no order.
template <class Iterator, class... Compare>
void parallel_sort(Iterator begin, Iterator end, Compare&&... compare) {
  std::sort(begin, end, std::forward<Compare>(compare)...);
}

class task_group {
 public:
  template <class Body>
  void run(Body body) {
    Body* const kept = new Body(std::move(body));  // the job's to delete
    __tsan_release(&order_.begun);
    group_.run([ kept, this ]() __attribute__((no_sanitize("thread"))) {
      const auto work = [kept] {
        const std::unique_ptr<Body> owner(kept);
        (*owner)();
      };
      job(work, order_)();
    });
  }
  auto wait() {
    return ordered(order_, [&] { return group_.wait(); });
  }
  void cancel() { group_.cancel(); }

 private:
  Order order_;
  ::tbb::task_group group_;
};

class task_arena {
 public:
  static constexpr int automatic = ::tbb::task_arena::automatic;
  explicit task_arena(int threads = automatic) : arena_(threads) {}
  template <class Body>
  auto execute(const Body& body) {
    Order order;
    return ordered(order, [&] { return arena_.execute(job(body, order)); });
  }

 private:
  ::tbb::task_arena arena_;
};

inline Order& pipeline_order() {
  static Order order;
  return order;
}

template <class In, class Out, class Body>
auto make_filter(::tbb::filter_mode mode, const Body& body) {
  const auto stage = [body](auto&&... arguments) __attribute__((no_sanitize("thread"))) {
    Order& order = pipeline_order();
    struct End {
      Order& order;
      ~End() { __tsan_release(&order.ended); }
    } end{order};
    __tsan_acquire(&order.begun);
    __tsan_acquire(&order.ended);
    return body(std::forward<decltype(arguments)>(arguments)...);
  };
  if constexpr (std::is_void_v<In>) {
    return ::tbb::make_filter<In, Out>(mode, [stage](::tbb::flow_control& flow) -> Out { return stage(flow); });
  } else {
    return ::tbb::make_filter<In, Out>(mode, [stage](In item) -> Out { return stage(item); });
  }
}

template <class Filter>
void parallel_pipeline(std::size_t tokens, const Filter& filter) {
  ordered(pipeline_order(), [&] { ::tbb::parallel_pipeline(tokens, filter); });
}

}  // namespace annotated_tbb

#define tbb annotated_tbb

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
template <class Index, class Body, class... Partitioner>
requires std::is_integral_v<Index>
void parallel_for(Index first, Index last, const Body& body, Partitioner&&... partitioner) {
  Order order;
  ordered(order,
          [&] { ::tbb::parallel_for(first, last, job(body, order), std::forward<Partitioner>(partitioner)...); });
}

template <class... Bodies>
void parallel_invoke(const Bodies&... bodies) {
  Order order;
  ordered(order, [&] { ::tbb::parallel_invoke(job(bodies, order)...); });
}

/// A body of a reduction as TBB splits and joins it: the body itself lies beside it, in memory whose reuse the
/// sanitizer sees, with what it happens after: the body it was split from, what it did before, and in the end those
/// joined to it.
template <class Body>
class Reduced {
 public:
  explicit Reduced(Body& body) : kept_(new Kept{&body, nullptr, {}}) { __tsan_release(&kept_->order.begun); }
  __attribute__((no_sanitize("thread"))) Reduced(Reduced& from, ::tbb::split split) {
    __tsan_acquire(&from.kept_->order.begun);
    auto own = std::make_unique<Body>(*from.kept_->body, split);
    Body* const body = own.get();
    kept_ = new Kept{body, std::move(own), {}};
    __tsan_release(&kept_->order.begun);
  }
  Reduced(const Reduced&) = delete;
  Reduced& operator=(const Reduced&) = delete;
  __attribute__((no_sanitize("thread"))) ~Reduced() {
    __tsan_acquire(&kept_->order.begun);
    __tsan_acquire(&kept_->order.ended);
    delete kept_;
  }
  template <class Range>
  __attribute__((no_sanitize("thread"))) void operator()(const Range& range) {
    __tsan_acquire(&kept_->order.begun);
    __tsan_acquire(&kept_->order.ended);
    (*kept_->body)(range);
    __tsan_release(&kept_->order.ended);
  }
  __attribute__((no_sanitize("thread"))) void join(Reduced& other) {
    __tsan_acquire(&kept_->order.ended);
    __tsan_acquire(&other.kept_->order.ended);
    kept_->body->join(*other.kept_->body);
    __tsan_release(&kept_->order.ended);
  }
  [[nodiscard]] Order& order() { return kept_->order; }

 private:
  struct Kept {
    Body* body;
    std::unique_ptr<Body> own;  ///< null: the caller's
    Order order;
  };
  Kept* kept_;
};

template <class Range, class Body, class... Partitioner>
void parallel_reduce(const Range& range, Body& body, Partitioner&&... partitioner) {
  Reduced<Body> reduced(body);
  ordered(reduced.order(), [&] { ::tbb::parallel_reduce(range, reduced, std::forward<Partitioner>(partitioner)...); });
}

/// The body of a reduction that was told as functions.
template <class Value, class Work, class Join>
struct FunctionBody {
  const Value& identity;
  const Work& work;
  const Join& joined;
  Value value;
  FunctionBody(const Value& start, const Work& w, const Join& j) : identity(start), work(w), joined(j), value(start) {}
  FunctionBody(FunctionBody& from, ::tbb::split /*split*/) : FunctionBody(from.identity, from.work, from.joined) {}
  template <class Range>
  void operator()(const Range& range) {
    value = work(range, std::as_const(value));
  }
  void join(FunctionBody& other) { value = joined(std::as_const(value), std::as_const(other.value)); }
};

template <class Range, class Value, class Work, class Join, class... Partitioner>
requires std::is_invocable_v<Join, const Value&, const Value&> Value parallel_reduce(const Range& range,
                                                                                     const Value& identity,
                                                                                     const Work& work, const Join& join,
                                                                                     Partitioner&&... partitioner) {
  FunctionBody<Value, Work, Join> body(identity, work, join);
  annotated_tbb::parallel_reduce(range, body, std::forward<Partitioner>(partitioner)...);  // not the library's
  return body.value;
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
  [[nodiscard]] ::tbb::task_arena& without_order() { return arena_; }

 private:
  ::tbb::task_arena arena_;
};

class task_scheduler_observer : public ::tbb::task_scheduler_observer {
 public:
  explicit task_scheduler_observer(task_arena& arena) : ::tbb::task_scheduler_observer(arena.without_order()) {}
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

// Control flow that stops to ask and goes on with the answer: coroutines that call each other.
//
// A solver written so reads as a loop, and yet many of them can wait at once for what one launch
// computes. Frames of the calls lie in memory of their owner, so that nothing is allocated on the
// way: the owner is the object whose member function a coroutine is, and has a `frames()`.
//
// GCC 12 breaks `if (co_await call())` where the call stops to ask: its value goes to a variable
// first.
#pragma once

#include <coroutine>
#include <cstddef>
#include <exception>
#include <new>
#include <optional>
#include <utility>

namespace trajopt {

// Memory of calls inside each other: the last one taken is the first given back.
class CallFrames {
 public:
  CallFrames() = default;
  CallFrames(const CallFrames&) = delete;
  CallFrames& operator=(const CallFrames&) = delete;

  // From the heap where there is no room.
  void* take(std::size_t bytes) {
    const std::size_t whole = (bytes + sizeof(Head) + kAlign - 1) / kAlign * kAlign;
    const bool fits = used_ + whole <= sizeof memory_;
    void* at = fits ? memory_ + used_ : ::operator new(whole);
    if (fits) used_ += whole;
    return new (at) Head{fits ? this : nullptr, fits ? used_ - whole : 0} + 1;
  }
  static void give_back(void* frame) {
    Head* head = static_cast<Head*>(frame) - 1;
    if (head->owner != nullptr) {
      head->owner->used_ = head->begin;
    } else {
      ::operator delete(head);
    }
  }

 private:
  static constexpr std::size_t kAlign = alignof(std::max_align_t);
  struct alignas(kAlign) Head {
    CallFrames* owner;
    std::size_t begin;
  };

  alignas(kAlign) std::byte memory_[4096];
  std::size_t used_ = 0;
};

// A call that has not begun; `co_await` runs it to its end, however often it stops to ask.
template <class T>
class [[nodiscard]] Task {
 public:
  struct promise_type {
    std::coroutine_handle<> caller = std::noop_coroutine();
    std::optional<T> value;
    std::exception_ptr error;

    template <class Owner, class... Arguments>
    static void* operator new(std::size_t bytes, Owner& owner, const Arguments&...) {
      return owner.frames().take(bytes);
    }
    static void operator delete(void* frame) { CallFrames::give_back(frame); }

    struct ToCaller {
      bool await_ready() noexcept { return false; }
      std::coroutine_handle<> await_suspend(std::coroutine_handle<promise_type> h) noexcept {
        return h.promise().caller;
      }
      void await_resume() noexcept {}
    };
    Task get_return_object() { return Task(Handle::from_promise(*this)); }
    std::suspend_always initial_suspend() noexcept { return {}; }
    ToCaller final_suspend() noexcept { return {}; }
    void return_value(T result) { value = std::move(result); }
    void unhandled_exception() { error = std::current_exception(); }
  };

  Task(Task&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Task& operator=(Task&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Task() {
    if (handle_) handle_.destroy();
  }

  // Of the outermost call: its first part.
  void start() { handle_.resume(); }
  bool done() const { return handle_.done(); }
  // Once done: what it returned, or the exception that ended it.
  T result() {
    if (handle_.promise().error) std::rethrow_exception(handle_.promise().error);
    return std::move(*handle_.promise().value);
  }

  bool await_ready() const noexcept { return false; }
  std::coroutine_handle<> await_suspend(std::coroutine_handle<> caller) noexcept {
    handle_.promise().caller = caller;
    return handle_;
  }
  T await_resume() { return result(); }

 private:
  using Handle = std::coroutine_handle<promise_type>;
  explicit Task(Handle handle) : handle_(handle) {}

  Handle handle_;
};

}  // namespace trajopt

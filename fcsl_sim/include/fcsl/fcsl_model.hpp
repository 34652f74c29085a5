/* SPDX-License-Identifier: Apache-2.0
 *
 * Models in C++17: makes the descriptor of fcsl_model.h from a struct with member functions, at compile time. Nothing
 * here allocates, and no code runs when the library is loaded.
 *
 *   struct pendulum {
 *       struct continuous { double angle, rate; };            // integrated: doubles only; left out without such states
 *       struct { double torque; } inputs;
 *       struct { double inertia, damping; } parameters;
 *       continuous state;                                     // or a struct whose first member is a `continuous`
 *       struct { double angle; } outputs;
 *
 *       continuous derivative(double t, const continuous &x) const { return {x.rate, …}; }
 *       void output(double t, const continuous &x) { outputs.angle = x.angle; }
 *   };
 *   static constexpr fcsl_field_t fields[] = {
 *       FCSL_MODEL_SCALAR(pendulum, FCSL_ROLE_INPUT, inputs.torque, "N*m", "of the motor"), …
 *   };
 *   FCSL_MODEL_EXPORT(pendulum, "a pendulum with damping", fields)
 *
 * The struct may have any of these members; a model has what it has, and a wrong signature does not compile:
 *
 *   const char *init(const fcsl::context &context)
 *   continuous derivative(double t, const continuous &x) const
 *   void output(double t, const continuous &x)               // without continuous states: output(double t)
 *   void update(const fcsl::context &context)
 *   void event(double t, const continuous &x, double *value) const
 *   void reset(const fcsl::context &context, uint32_t number)
 *   static constexpr fcsl_model_event_t events[] = {{"bounce", FCSL_FALLING, "touches the ground"}};
 *   static constexpr bool is_second_order = true;
 */
#ifndef FCSL_MODEL_HPP
#define FCSL_MODEL_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

#include "fcsl/fcsl_model.h"

namespace fcsl
{

/* Services that a model may use in init, update and reset. */
class context
{
  public:
    explicit context(const fcsl_model_context_t &given) noexcept : given_(given)
    {
    }
    int64_t time_ns() const noexcept
    {
        return given_.time_ns;
    }
    /* Mean 0, standard deviation 1; NaN: no such stream. */
    double gaussian(uint32_t stream) const noexcept
    {
        return given_.gaussian(given_.noise, stream);
    }
    /* In [0, 1); NaN: no such stream. */
    double uniform(uint32_t stream) const noexcept
    {
        return given_.uniform(given_.noise, stream);
    }

  private:
    const fcsl_model_context_t &given_;
};

namespace detail
{

/* ---- type and shape of a field ----------------------------------------------------------------------------------- */

template <typename T> constexpr uint8_t type_of() noexcept
{
    if constexpr (std::is_same_v<T, bool>) {
        return FCSL_BOOL;
    } else if constexpr (std::is_same_v<T, int32_t>) {
        return FCSL_I32;
    } else if constexpr (std::is_same_v<T, int64_t>) {
        return FCSL_I64;
    } else if constexpr (std::is_same_v<T, uint32_t>) {
        return FCSL_U32;
    } else if constexpr (std::is_same_v<T, uint64_t>) {
        return FCSL_U64;
    } else if constexpr (std::is_same_v<T, float>) {
        return FCSL_F32;
    } else {
        static_assert(std::is_same_v<T, double>,
                      "a field is bool, int32_t, int64_t, uint32_t, uint64_t, float or double, or an array of these");
        return FCSL_F64;
    }
}

template <std::size_t... extents> struct shape {
    static constexpr uint32_t rank = sizeof...(extents);
    static constexpr uint32_t values[] = {static_cast<uint32_t>(extents)...};
};
template <> struct shape<> {
    static constexpr uint32_t rank = 0;
    static constexpr const uint32_t *values = nullptr;
};

/* A scalar, a vector or a matrix: C arrays and std::array. */
template <typename T> struct member : shape<> {
    using scalar = T;
};
template <typename T, std::size_t n> struct member<T[n]> : shape<n> {
    using scalar = T;
};
template <typename T, std::size_t n> struct member<std::array<T, n>> : shape<n> {
    using scalar = T;
};
template <typename T, std::size_t n, std::size_t m> struct member<T[n][m]> : shape<n, m> {
    using scalar = T;
};
template <typename T, std::size_t n, std::size_t m> struct member<std::array<std::array<T, m>, n>> : shape<n, m> {
    using scalar = T;
};

template <typename Member, uint32_t rank>
constexpr fcsl_field_t field(const char *path, unsigned role, std::size_t offset, const char *unit,
                             const char *doc) noexcept
{
    using described = member<Member>;
    static_assert(described::rank == rank, "FCSL_MODEL_SCALAR is for a scalar, _VECTOR for T[n], _MATRIX for T[n][m]");
    fcsl_field_t made{};
    made.path = path;
    made.role = static_cast<uint8_t>(role & 0x3fu);
    made.type = type_of<typename described::scalar>();
    made.flags = FCSL_MODEL_FLAGS(role);
    made.rank = rank;
    made.shape = described::values;
    made.count = sizeof(Member) / sizeof(typename described::scalar);
    made.offset = static_cast<uint32_t>(offset);
    made.size = sizeof(Member);
    made.instance = FCSL_NONE;
    made.connected_from = FCSL_NONE;
    made.unit = unit;
    made.doc = doc;
    made.minimum = -std::numeric_limits<double>::infinity();
    made.maximum = std::numeric_limits<double>::infinity();
    return made;
}

/* ---- members that a model has or not ----------------------------------------------------------------------------- */

/* has_NAME<M>: M has a member NAME of any kind. Looking it up in a struct derived from M and from one with that member
 * is ambiguous exactly then. A member with a wrong signature is therefore found, and its call does not compile. */
#define FCSL_DETECT(name_)                                                                                             \
    struct with_##name_ {                                                                                              \
        void name_();                                                                                                  \
    };                                                                                                                 \
    template <typename M> struct either_##name_ : M, with_##name_ {};                                                  \
    template <typename M, typename = void> struct found_##name_ : std::true_type {};                                   \
    template <typename M>                                                                                              \
    struct found_##name_<M, std::void_t<decltype(&either_##name_<M>::name_)>> : std::false_type {};                    \
    template <typename M> constexpr bool has_##name_ = found_##name_<M>::value

FCSL_DETECT(init);
FCSL_DETECT(derivative);
FCSL_DETECT(output);
FCSL_DETECT(update);
FCSL_DETECT(event);
FCSL_DETECT(reset);
FCSL_DETECT(next_time);
FCSL_DETECT(events);
FCSL_DETECT(is_second_order);
#undef FCSL_DETECT

template <typename M, typename = void> struct continuous {
    using type = void;
};
template <typename M> struct continuous<M, std::void_t<typename M::continuous>> {
    using type = typename M::continuous;
};
template <typename M> constexpr bool is_integrated = !std::is_void_v<typename continuous<M>::type>;

/* ---- the functions of the descriptor ----------------------------------------------------------------------------- */

template <typename M> typename continuous<M>::type states(const double *x) noexcept
{
    typename continuous<M>::type copy;
    std::memcpy(&copy, x, sizeof copy);
    return copy;
}

/* noexcept: an exception ends the simulator, with its message, instead of crossing the ABI.
 * {t}: so a function that takes its time as a float does not compile. */
template <typename M> const char *init(void *self, const fcsl_model_context_t *given) noexcept
{
    return static_cast<M *>(self)->init(context(*given));
}

template <typename M> void derivative(const void *self, double t, const double *x, double *dx) noexcept
{
    const typename M::continuous rates = static_cast<const M *>(self)->derivative({t}, states<M>(x));
    std::memcpy(dx, &rates, sizeof rates);
}

template <typename M> void output(void *self, double t, [[maybe_unused]] const double *x) noexcept
{
    if constexpr (is_integrated<M>) {
        static_cast<M *>(self)->output({t}, states<M>(x));
    } else {
        static_cast<M *>(self)->output({t});
    }
}

template <typename M> void update(void *self, const fcsl_model_context_t *given) noexcept
{
    static_cast<M *>(self)->update(context(*given));
}

template <typename M> void event(const void *self, double t, [[maybe_unused]] const double *x, double *value) noexcept
{
    if constexpr (is_integrated<M>) {
        static_cast<const M *>(self)->event({t}, states<M>(x), value);
    } else {
        static_cast<const M *>(self)->event({t}, value);
    }
}

template <typename M> void reset(void *self, const fcsl_model_context_t *given, uint32_t number) noexcept
{
    static_cast<M *>(self)->reset(context(*given), number);
}

template <typename M> double next_time(const void *self, double t) noexcept
{
    return static_cast<const M *>(self)->next_time({t});
}

/* ---- the descriptor ---------------------------------------------------------------------------------------------- */

template <typename M> constexpr void check() noexcept
{
    static_assert(std::is_standard_layout_v<M> && std::is_trivially_copyable_v<M>,
                  "a model is one flat struct: no virtual function, no base with members, no std::string or alike");
    static_assert(std::is_trivially_default_constructible_v<M>,
                  "instances are made of zeros, so initializers of members would do nothing: set them in init");
    static_assert(has_derivative<M> == is_integrated<M>,
                  "a model has a type `continuous` and a function `derivative`, or neither");
    static_assert(has_event<M> == has_events<M> && has_reset<M> == has_events<M>,
                  "a model has `events`, `event` and `reset` together, or none of them");
    static_assert(has_output<M> || !is_integrated<M>, "a model with continuous states has a function `output`");
    static_assert(has_output<M> || has_update<M>, "a model has a function `output` or `update`");
}

/* The states of `continuous` are fields of doubles, as far as the table names them. */
template <typename M, std::size_t n> constexpr bool are_doubles(const fcsl_field_t (&fields)[n]) noexcept
{
    if constexpr (is_integrated<M>) {
        for (const fcsl_field_t &field : fields) {
            const bool inside = field.offset >= offsetof(M, state) &&
                                field.offset < offsetof(M, state) + sizeof(typename M::continuous);
            if (inside && field.type != FCSL_F64) {
                return false;
            }
        }
    }
    return true;
}

template <typename M, std::size_t n>
constexpr fcsl_model_t model(const char *name, const char *doc, const fcsl_field_t (&fields)[n],
                             std::size_t sampled_offset) noexcept
{
    check<M>();
    fcsl_model_t made{};
    made.abi_version = FCSL_MODEL_ABI_VERSION;
    made.name = name;
    made.doc = doc;
    made.fields = fields;
    made.field_count = n;
    made.size = sizeof(M);
    made.align = alignof(M);
    made.sampled_offset = static_cast<uint32_t>(sampled_offset);
    if constexpr (is_integrated<M>) {
        using states = typename M::continuous;
        static_assert(sizeof(states) % sizeof(double) == 0 && alignof(states) == alignof(double),
                      "`continuous` has members of type double alone");
        static_assert(sizeof(M::state) >= sizeof(states), "`state` is a `continuous`, or begins with one");
        made.continuous_offset = static_cast<uint32_t>(offsetof(M, state));
        made.continuous_count = sizeof(states) / sizeof(double);
    }
    if constexpr (has_is_second_order<M>) {
        static_assert(is_integrated<M> || !M::is_second_order, "is_second_order needs continuous states");
        made.is_second_order = M::is_second_order;
    }
    if constexpr (has_events<M>) {
        made.events = M::events;
        made.event_count = sizeof M::events / sizeof *M::events;
    }
    if constexpr (has_init<M>) {
        made.init = init<M>;
    }
    if constexpr (has_derivative<M>) {
        made.derivative = derivative<M>;
    }
    if constexpr (has_output<M>) {
        made.output = output<M>;
    }
    if constexpr (has_update<M>) {
        made.update = update<M>;
    }
    if constexpr (has_event<M>) {
        made.event = event<M>;
    }
    if constexpr (has_reset<M>) {
        made.reset = reset<M>;
    }
    if constexpr (has_next_time<M>) {
        made.next_time = next_time<M>;
    }
    return made;
}

} // namespace detail
} // namespace fcsl

/* The macros of fcsl_model.h, in C++: a member may also be a std::array. */
#undef FCSL_MODEL_SCALAR
#undef FCSL_MODEL_VECTOR
#undef FCSL_MODEL_MATRIX
#undef FCSL_MODEL_EXTENT
#undef FCSL_MODEL_FIELD
#undef FCSL_MODEL_TYPE
#define FCSL_MODEL_SCALAR(struct_, role_, path_, unit_, doc_) FCSL_MODEL_FIELD(struct_, role_, path_, 0, unit_, doc_)
#define FCSL_MODEL_VECTOR(struct_, role_, path_, unit_, doc_) FCSL_MODEL_FIELD(struct_, role_, path_, 1, unit_, doc_)
#define FCSL_MODEL_MATRIX(struct_, role_, path_, unit_, doc_) FCSL_MODEL_FIELD(struct_, role_, path_, 2, unit_, doc_)
#define FCSL_MODEL_FIELD(struct_, role_, path_, rank_, unit_, doc_)                                                    \
    ::fcsl::detail::field<decltype(::std::declval<struct_ &>().path_), rank_>(#path_, (role_),                         \
                                                                              offsetof(struct_, path_), unit_, doc_)

/* Exports a model. Its name is that of its struct and of its source file; `fields_` is a constexpr array. */
#define FCSL_MODEL_EXPORT(struct_, doc_, fields_) FCSL_MODEL_EXPORT_AT(struct_, doc_, fields_, FCSL_NO_OFFSET)
/* The same for a sensor with dropouts: `sampled_` is a bool, `outputs.sampled`, that update sets to false where it took
 * no sample. */
#define FCSL_MODEL_EXPORT_SENSOR(struct_, doc_, fields_, sampled_)                                                     \
    FCSL_MODEL_EXPORT_AT(struct_, doc_, fields_, offsetof(struct_, sampled_));                                         \
    static_assert(::std::is_same_v<decltype(::std::declval<struct_ &>().sampled_), bool>, #sampled_ " is a bool")
#define FCSL_MODEL_EXPORT_AT(struct_, doc_, fields_, sampled_offset_)                                                  \
    static_assert(::fcsl::detail::are_doubles<struct_>(fields_), "`continuous` has members of type double alone");     \
    static constexpr fcsl_model_t struct_##_descriptor =                                                               \
        ::fcsl::detail::model<struct_>(#struct_, doc_, fields_, sampled_offset_);                                      \
    extern "C" const fcsl_model_t *const fcsl_models[] = {&struct_##_descriptor, nullptr}

#endif /* FCSL_MODEL_HPP */

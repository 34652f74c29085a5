// SPDX-License-Identifier: Apache-2.0
//! `model!`

/// Declares the structs of a model, and exports it.
///
/// A field is `name: type = "unit";`, with a `///` comment of one line above it, if any. All groups are optional, but in
/// this order. An output that depends on an input of the same instant is `name: type = "unit", feedthrough;`.
/// `sampled output;` names a `bool` output that `update` sets to false where it took no sample.
///
/// ```ignore
/// fcsl_model::model! {
///     /// a ball that bounces
///     pub Ball as "ball";
///     inputs { wind: [f64; 3] = "m/s"; }
///     parameters { gravity: f64 = "m/s^2"; }
///     continuous { height: f64 = "m"; speed: f64 = "m/s"; }
///     state { bounces: u32 = ""; }
///     outputs { height: f64 = "m"; }
///     events { /// touches the ground
///         bounce: falling; }
/// }
/// ```
///
/// `second_order continuous` instead of `continuous`: the first half of these states are positions, the second half
/// their velocities in the same order, and the accelerations do not depend on velocities.
#[macro_export]
macro_rules! model {
    (
        $(#[doc = $doc:literal])?
        $vis:vis $model:ident as $name:literal;
        $(inputs { $($inputs:tt)* })?
        $(parameters { $($parameters:tt)* })?
        $(continuous { $($continuous:tt)* })?
        $(second_order continuous { $($second_order:tt)* })?
        $(state { $($state:tt)* })?
        $(outputs { $($outputs:tt)* })?
        $(sampled $sampled:ident;)?
        $(events { $($(#[doc = $event_doc:literal])? $event:ident: $crossing:ident;)* })?
    ) => {
        $(#[doc = $doc])?
        $vis struct $model;
        $crate::__struct!($vis Inputs: $($($inputs)*)?);
        $crate::__struct!($vis Parameters: $($($parameters)*)?);
        $crate::__struct!($vis Continuous: $($($continuous)*)? $($($second_order)*)?);
        $crate::__struct!($vis State: $($($state)*)?);
        $crate::__struct!($vis Outputs: $($($outputs)*)?);

        impl $crate::Model for $model {
            type Inputs = Inputs;
            type Parameters = Parameters;
            type Continuous = Continuous;
            type State = State;
            type Outputs = Outputs;
        }

        const _: () = {
            use $crate::detail as d;
            #[allow(unused_imports)]
            use d::Without as _;

            type Instance = $crate::Instance<$model>;
            const SECOND_ORDER: &[&str] = &[$(stringify!($($second_order)*))?];
            const EVENTS: usize = <[&str]>::len(&[$($(stringify!($event)),*)?]);
            type Functions = d::Functions<$model, EVENTS>;

            $crate::__doubles!($($($continuous)*)? $($($second_order)*)?);
            const FIELD_COUNT: usize = $crate::__count!($($($inputs)*)?) + $crate::__count!($($($parameters)*)?)
                + $crate::__count!($($($continuous)*)? $($($second_order)*)?) + $crate::__count!($($($state)*)?)
                + $crate::__count!($($($outputs)*)?);
            static FIELDS: d::Table<d::Field, FIELD_COUNT> = d::Table($crate::__fields!(
                []
                {inputs "inputs." Inputs ROLE_INPUT: $($($inputs)*)?}
                {parameters "parameters." Parameters ROLE_PARAMETER: $($($parameters)*)?}
                {continuous "state." Continuous ROLE_STATE: $($($continuous)*)? $($($second_order)*)?}
                {state "state." State ROLE_STATE: $($($state)*)?}
                {outputs "outputs." Outputs ROLE_OUTPUT: $($($outputs)*)?}
            ));
            static EVENT_TABLE: d::Table<d::ModelEvent, EVENTS> = d::Table([$($(d::ModelEvent {
                name: d::c_string(concat!(stringify!($event), "\0")).as_ptr(),
                crossing: $crate::__crossing!($crossing),
                doc: d::trimmed(d::c_string(concat!($($event_doc,)? "\0"))),
            }),*)?]);
            const _: () = assert!(
                Functions::DERIVATIVE.is_some() == (size_of::<Continuous>() > 0),
                "a model has continuous states and implements Derivative, or neither"
            );
            const _: () = assert!(
                Functions::EVENT.is_some() == (EVENTS > 0) && Functions::RESET.is_some() == (EVENTS > 0),
                "a model has events and implements Event and Reset, or none of these"
            );
            const _: () = assert!(
                Functions::OUTPUT.is_some() || size_of::<Continuous>() == 0,
                "a model with continuous states implements Output"
            );
            const _: () = assert!(
                Functions::OUTPUT.is_some() || Functions::UPDATE.is_some(),
                "a model implements Output or Update"
            );

            static DESCRIPTOR: d::Table<d::ModelDescriptor, 1> = d::Table([d::ModelDescriptor {
                abi_version: d::MODEL_ABI_VERSION,
                name: d::c_string(concat!($name, "\0")).as_ptr(),
                doc: d::trimmed(d::c_string(concat!($($doc,)? "\0"))),
                fields: FIELDS.0.as_ptr(),
                field_count: FIELD_COUNT as u32,
                size: size_of::<Instance>() as u32,
                align: align_of::<Instance>() as u32,
                continuous_offset: d::offset_of!(Instance, continuous) as u32,
                continuous_count: (size_of::<Continuous>() / 8) as u32,
                is_second_order: SECOND_ORDER.len() as u8,
                sampled_offset: [
                    $({
                        const _: fn(&Outputs) -> &bool = |outputs| &outputs.$sampled;
                        (d::offset_of!(Instance, outputs) + d::offset_of!(Outputs, $sampled)) as u32
                    },)?
                    d::NO_OFFSET,
                ][0],
                events: EVENT_TABLE.0.as_ptr(),
                event_count: EVENTS as u32,
                init: Functions::INIT,
                derivative: Functions::DERIVATIVE,
                output: Functions::OUTPUT,
                update: Functions::UPDATE,
                event: Functions::EVENT,
                reset: Functions::RESET,
                next_time: Functions::NEXT_TIME,
            }]);

            #[allow(non_upper_case_globals)]
            #[no_mangle]
            static fcsl_models: d::Table<*const d::ModelDescriptor, 2> =
                d::Table([&DESCRIPTOR.0[0], core::ptr::null()]);

            #[cfg(not(test))]
            #[panic_handler]
            fn panic(info: &core::panic::PanicInfo) -> ! {
                d::abort($name, info)
            }
        };
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __struct {
    ($vis:vis $name:ident: $($(#[doc = $doc:literal])? $field:ident: $type:ty = $unit:literal $(, $flag:ident)?;)*) => {
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq)]
        $vis struct $name {
            $($(#[doc = $doc])? pub $field: $type,)*
        }
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __doubles {
    ($($(#[doc = $doc:literal])? $field:ident: $type:ty = $unit:literal;)*) => {
        const _: () = { $(d::is_float64::<$type>();)* };
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __count {
    ($($(#[doc = $doc:literal])? $field:ident: $type:ty = $unit:literal $(, $flag:ident)?;)*) => {
        <[&str]>::len(&[$(stringify!($field)),*])
    };
}

/// The entries of all groups, one group after another.
#[doc(hidden)]
#[macro_export]
macro_rules! __fields {
    ([$($made:expr,)*]) => { [$($made),*] };
    ([$($made:expr,)*] {$member:ident $prefix:literal $struct:ident $role:ident:
        $($(#[doc = $doc:literal])? $field:ident: $type:ty = $unit:literal $(, $flag:ident)?;)*
    } $($rest:tt)*) => {
        $crate::__fields!([$($made,)* $(d::field::<$type>(
            d::c_string(concat!($prefix, stringify!($field), "\0")),
            d::$role,
            0 $(| $crate::__flag!($flag $role))?,
            d::offset_of!(Instance, $member) + d::offset_of!($struct, $field),
            d::c_string(concat!($unit, "\0")),
            d::c_string(concat!($($doc,)? "\0")),
        ),)*] $($rest)*)
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __flag {
    (feedthrough ROLE_OUTPUT) => {
        d::FIELD_FEEDTHROUGH
    };
    (optional ROLE_INPUT) => {
        d::FIELD_OPTIONAL
    };
    (optional ROLE_PARAMETER) => {
        d::FIELD_OPTIONAL
    };
    (table ROLE_PARAMETER) => {
        d::FIELD_TABLE
    };
    ($flag:ident $role:ident) => {
        compile_error!(concat!(
            "`",
            stringify!($flag),
            "`: only `feedthrough` of an output, `optional` of an input or a parameter, or `table` of a parameter may follow a unit"
        ))
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __crossing {
    (falling) => {
        1
    };
    (rising) => {
        2
    };
    (either) => {
        3
    };
    ($other:ident) => {
        compile_error!(concat!("`", stringify!($other), "`: an event is falling, rising or either"))
    };
}

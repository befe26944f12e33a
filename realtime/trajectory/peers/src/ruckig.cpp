// What cpp.rs calls: ruckig with the joints known at compile time, input already set.
#include <ruckig/ruckig.hpp>

using namespace ruckig;

template<size_t N> struct Solver {
    Ruckig<N> otg;
    InputParameter<N> input;
    Trajectory<N> trajectory;
    std::array<double, N> position, velocity, acceleration;
};

// `numbers`: nine a joint, in the order of the fields below.
#define JOINTS(N)                                                                                            \
    extern "C" Solver<N>* ruckig_new_##N() { return new Solver<N>(); }                                       \
    extern "C" void ruckig_delete_##N(Solver<N>* solver) { delete solver; }                                  \
    extern "C" InputParameter<N>* ruckig_input_##N(const double* numbers, bool velocity) {                   \
        auto* input = new InputParameter<N>();                                                               \
        input->control_interface = velocity ? ControlInterface::Velocity : ControlInterface::Position;       \
        for (size_t i = 0; i < N; ++i, numbers += 9) {                                                       \
            input->current_position[i] = numbers[0];                                                         \
            input->current_velocity[i] = numbers[1];                                                         \
            input->current_acceleration[i] = numbers[2];                                                     \
            input->target_position[i] = numbers[3];                                                          \
            input->target_velocity[i] = numbers[4];                                                          \
            input->target_acceleration[i] = numbers[5];                                                      \
            input->max_velocity[i] = numbers[6];                                                             \
            input->max_acceleration[i] = numbers[7];                                                         \
            input->max_jerk[i] = numbers[8];                                                                 \
        }                                                                                                    \
        return input;                                                                                        \
    }                                                                                                        \
    extern "C" void ruckig_input_delete_##N(InputParameter<N>* input) { delete input; }                      \
    extern "C" int ruckig_calculate_##N(Solver<N>* solver, const InputParameter<N>* input) {                 \
        return solver->otg.calculate(*input, solver->trajectory);                                            \
    }                                                                                                        \
    extern "C" double ruckig_duration_##N(const Solver<N>* solver) { return solver->trajectory.get_duration(); } \
    extern "C" const double* ruckig_at_##N(Solver<N>* solver, double time) {                                 \
        solver->trajectory.at_time(time, solver->position, solver->velocity, solver->acceleration);          \
        return solver->position.data();                                                                      \
    }

JOINTS(1)
JOINTS(3)
JOINTS(6)
JOINTS(7)
